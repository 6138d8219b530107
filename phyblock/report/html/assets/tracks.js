/* The views of two tracks: a question with its pictures and options, the turns of an episode. */
"use strict";

const Question = (() => {
  const LETTERS = "ABCD";
  const isPicture = (option) => /^<img[1-4]>$/.test(option);

  function drawn(question, label) {
    const one = question.pictures.find((candidate) => candidate.label === label);
    if (!one) return null;
    return Detail.picture(`Picture ${label}`, one.blocks,
      { view: one.view, framed: one.framed.length ? one.framed : one.blocks, marks: one.marks, grid: true }, "goal");
  }

  /** The question as it was shown: pictures, text, options, the right one; and its evidence. */
  function about(question, sample) {
    const shown = question.pictures.filter((one) => !LETTERS.includes(one.label));
    return el("section", { class: "card question" },
      el("p", { class: "muted" }, `${question.subtask} ${Data.index.subtask_names[question.subtask] || ""} · scene ${sample.scene}`),
      el("p", { class: "asked" }, question.text),
      shown.length ? el("div", { class: "pictures" }, shown.map((one) =>
        el("figure", {}, drawn(question, one.label), shown.length > 1 ? el("figcaption", { class: "muted" }, one.label) : null))) : null,
      options(question),
      Detail.folded("Evidence", el("pre", { class: "text" }, JSON.stringify(question.evidence, null, 2))));
  }

  function options(question) {
    const { answer } = question;
    return el("ol", { class: question.options.every(isPicture) ? "options pictured" : "options" }, question.options.map((option, i) => {
      const place = answer.indexOf(LETTERS[i]);
      const isRight = answer.length === 1 && place === 0;
      const mark = answer.length > 1 ? `${place + 1}.` : "✓";
      return el("li", { class: isRight ? "right" : "" },
        el("span", { class: "letter" }, LETTERS[i]),
        isPicture(option) ? drawn(question, LETTERS[i]) : el("span", {}, option),
        isRight || answer.length > 1
          ? el("span", { class: "mark", title: answer.length > 1 ? "Place in the right order" : "The right answer" }, mark)
          : null);
    }));
  }

  function answer(sample) {
    const { answer: given } = sample.record;
    if (!given) return null;
    const said = given.given === null || given.given === undefined ? "no answer" : given.given;
    return el("section", { class: "card answer" },
      el("p", { class: "facts" },
        el("span", { class: `verdict ${given.correct ? "right" : "wrong"}` }, given.correct ? "✓ Right" : "✗ Wrong"),
        el("span", { class: "fact" }, "Answered ", el("b", { class: "number" }, said)),
        el("span", { class: "fact" }, "Right is ", el("b", { class: "number" }, given.right)),
        notes(sample.record.question),
        sample.outcome === "ok" ? null : el("span", { class: "chip" }, Words.named(sample.outcome))));
  }

  function notes(shown) {
    const told = [];
    if (shown?.rotation) told.push(`options rotated by ${shown.rotation}`);
    if (shown?.blind) told.push("sent without pictures");
    if (shown?.wrong_image) told.push("sent with pictures of another scene");
    return told.length ? el("span", { class: "fact muted" }, told.join("; ")) : null;
  }

  return { about, answer };
})();

const Turns = (() => {
  /** Every reply of an episode, folded but for what became of it. */
  function cards(record) {
    return el("section", { class: "card" }, el("h3", {}, "Turns"),
      el("ol", { class: "turns" }, record.turns.map((turn) => el("li", {}, el("details", {},
        el("summary", {}, ...head(turn)),
        Detail.parsed(turn.parse),
        turn.reply?.reasoning ? Detail.folded("Reasoning", el("pre", { class: "text" }, turn.reply.reasoning)) : null,
        el("pre", { class: "text reply" }, turn.reply?.text || "(empty)"),
        Detail.promptCard(turn.prompt))))));
  }

  function head(turn) {
    const move = turn.parse?.move;
    const said = move === null || move === undefined ? "" : `said ${move}`;
    const number = el("span", { class: "number" }, String(turn.step || turn.n));
    // Of several replies to a step, one speaks for all.
    if (turn.outcome === null) return [number, el("span", { class: "muted" }, `outvoted, ${said}`)];
    const isPlaced = turn.outcome === "placed";
    return [number, el("span", { class: `verdict ${isPlaced ? "right" : "wrong"}` },
      `${isPlaced ? "✓" : "✗"} ${Words.named(turn.outcome)}`), el("span", { class: "muted" }, said)];
  }

  return { cards };
})();
