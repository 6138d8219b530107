/* Under what a step did: where a wrong one's block is drawn, and the sentence behind it. */
"use strict";

const Why = (() => {
  /** A note on the step that the player stands at. */
  function note(sample, scene, steps, player) {
    const { reply, parse, turns, pose } = sample.record;
    const body = el("div", { class: "why" });
    let quotes = null;
    player.listeners.push(() => {
      const step = player.at >= player.last ? null : steps[player.at - 1];
      body.replaceChildren();
      if (!step) return;
      quotes = quotes || (turns ? steps.map((one) => Quotes.ofMove(one.turn.reply?.text, one.number))
        : Quotes.ofPlan(reply?.text || "", parse?.plan || [], !pose));
      const where = step.why && scene ? Overlay.words(scene, step) : "";
      if (where) body.append(el("p", { class: "muted" }, where));
      const quote = quotes[player.at - 1];
      if (quote) body.append(el("blockquote", { class: "quote" }, quote));
    });
    return body;
  }

  return { note };
})();
