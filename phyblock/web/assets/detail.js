/* One sample, whole: what the model saw, what it did, what it said, and the same of another. */
"use strict";

const Detail = (() => {
  let player = null;
  let shown = 0;
  let place = null;
  let tab = "";
  let told = () => {};

  /**
   * Show sample `row`, beside it sample `other` of the same item where one is given.
   *
   * `at` may say the step, the view [degrees] and the tab of an address.
   */
  async function show(into, row, other, listed, at = {}) {
    place = into;
    const turn = ++shown;
    player?.stop();
    const samples = [row, other].filter((n) => n >= 0).map(Data.sample);
    try {
      const loaded = await Promise.all(samples.map(async (sample) => ({
        ...sample, listed, setting: listed?.name || "", record: await Data.entry("records", sample.row),
      })));
      const sample = loaded[0];
      const scene = Data.index.starts.scenes.length ? await Data.entry("scenes", sample.sceneNumber) : null;
      const question = sample.question >= 0 ? await Data.entry("questions", sample.question) : null;
      // A later choice may have been quicker.
      if (turn !== shown) return;
      if (at.tab !== undefined) tab = at.tab;
      place.replaceChildren(...build(loaded, scene, question));
      if (player && at.view) player.view = at.view;
      if (player && at.step !== undefined) player.seek(at.step);
      player?.listeners.push(() => told());
      drawn();
    } catch (error) {
      if (turn === shown) place.replaceChildren(el("p", { class: "notice" }, error.message));
    }
  }

  function build(loaded, inFile, question) {
    const scene = inFile && Steps.asShown(inFile, loaded[0].record);
    const several = loaded.length > 1;
    player = null;
    const did = question ? Question.about(question, loaded)
      : [assembly(loaded, scene, several), scene ? candidates(scene) : []];
    const saw = el("section", { class: "card" }, columns(loaded.map((sample) =>
      [several ? heading(sample) : null, Sent.panel(sample)])));
    const said = columns(loaded.map((sample) => [
      several ? heading(sample) : null, question ? Question.answer(sample) : null, ...texts(sample)]));
    const title = question ? "The question" : loaded.some(builds) ? "What it built" : "The scene";
    return [tabs([["saw", "What the model saw", saw], ["did", title, did]], loaded), said];
  }

  /** What was sent is shown first where anything was; what a person chose stays. */
  function tabs(all, loaded) {
    const { record } = loaded[0];
    const isSent = Boolean(record.prompt || record.turns?.some((turn) => turn.prompt));
    const now = all.some(([name]) => name === tab) ? tab : isSent ? "saw" : "did";
    const buttons = all.map(([name, title]) => el("button", {
      type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}`, onclick: () => choose(name),
    }, title));
    const panels = all.map(([name, title, content]) => el("div", {
      role: "tabpanel", id: `panel-${name}`, class: "panel", "aria-labelledby": `tab-${name}`,
    }, el("h2", { class: "on-paper" }, title), content));
    const mark = (chosen) => all.forEach(([name], i) => {
      buttons[i].setAttribute("aria-selected", String(name === chosen));
      buttons[i].tabIndex = name === chosen ? 0 : -1;
      panels[i].hidden = name !== chosen;
    });
    function choose(name) {
      tab = name;
      mark(name);
      drawn();
      told();
    }
    const list = el("div", {
      role: "tablist", "aria-label": "Views of the sample",
      onkeydown: (event) => {
        const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
        if (!by) return;
        event.preventDefault();
        const i = (buttons.indexOf(document.activeElement) + by + all.length) % all.length;
        choose(all[i][0]);
        buttons[i].focus();
      },
    }, buttons);
    mark(now);
    return el("div", { class: "tabs" }, list, panels);
  }

  /** Goal and what was built side by side, under one clock; the steps below. */
  function assembly(loaded, scene, several) {
    const runs = loaded.map(({ record, setting }) => Runs.of(scene, record, setting, headline(record.scores, setting)));
    const longest = Math.max(...runs.map(({ steps }) => steps.length));
    const noun = loaded[0].record.turns ? "Turn" : "Step";
    player = new Stage.Player(longest + 1, Stage.wrongSteps(runs));
    const panels = loaded.map((sample, i) => (runs[i].steps.length ? Stage.panel(runs[i], player, noun, scene) : null));
    const stages = panels.map((panel, i) => [
      several ? heading(loaded[i]) : null, verdict(loaded[i]), panel ? panel.said : nothing(loaded[i]),
      panel ? Why.note(loaded[i], scene, runs[i].steps, player) : null]);
    const wide = Math.max(...runs.map(({ titles }) => titles.length)) > 1 ? " wide" : "";
    const built = panels.flatMap((panel, i) => [
      runs[i].titles.map((title, k) => el("figure", { class: "built" },
        el("figcaption", {}, captionOf(loaded[i], title, several, wide)), panel?.pictures[k]?.canvas)),
      several ? null : el("div", { class: "about-step" }, stages[i])]);
    return el("section", { class: "card" },
      scene ? null : el("p", { class: "notice" }, Data.index.no_scenes || "The data set has no such scene."),
      el("div", { class: `sides${several ? " two" : ""}${wide}` }, scene ? goal(scene, loaded[0]) : null,
        scene ? built : stages.map((parts) => el("div", {}, parts))),
      several && scene ? el("div", { class: "columns two" }, stages.map((parts) => el("div", {}, parts))) : null,
      longest ? Stage.controls(player, noun) : null,
      panels.map((panel, i) => panel && [several ? el("p", { class: "muted strip-of" }, loaded[i].model) : null, panel.strip]).flat());
  }

  function columns(contents) {
    return el("div", { class: contents.length > 1 ? "columns two" : "columns" },
      contents.map((children) => el("div", {}, children)));
  }

  const captionOf = ({ model }, title, several, wide) =>
    (several ? `${model}${wide && `: ${title.toLowerCase()}`}` : title);

  const heading = (sample) => el("p", { class: "model-name" }, sample.model);

  const headline = (scores, setting) => scores.find((score) =>
    score.setting === setting && score.matcher === Data.index.matcher && score.placed) || null;

  /** Whether a sample is of blocks that are placed; what another track asks for is in its reply. */
  const builds = ({ record }) => Boolean(record.turns || record.parse?.plan);

  /** Why there is nothing on the stage; a reply that was read and builds nothing says it all. */
  function nothing(sample) {
    const { record } = sample;
    if (sample.outcome === "ok" && !builds(sample)) return null;
    const problem = record.parse?.problem ? `: ${Words.named(record.parse.problem)}` : "";
    const why = record.error ? record.error.message
      : record.reply ? `Nothing could be read out of the reply${problem}.` : "There is no reply.";
    return el("p", { class: "notice" }, why);
  }

  /** Counts and metrics of a sample in one line. */
  function verdict(sample) {
    const score = sample.scores[sample.setting];
    const { record } = sample;
    const facts = [];
    if (sample.outcome !== "ok") facts.push(el("span", { class: "chip" }, Words.named(sample.outcome)));
    // Parts of a mean are no counts: the view of such a sample says what they come to.
    if (score && sample.listed.is_counted) {
      for (const [name, value] of [["F1", Words.percent(score.f1)], ["TP", score.tp], ["FP", score.fp], ["FN", score.fn]]) {
        facts.push(el("span", { class: "fact" }, `${name} `, el("b", { class: "number" }, String(value))));
      }
      facts.push(el("span", { class: "fact muted" }, `Setting ${sample.setting}`));
    }
    for (const [name, value] of record.pose ? Poses.facts(record) : []) {
      facts.push(el("span", { class: "fact" }, `${name} `, el("b", { class: "number" }, value)));
    }
    if (record.ending) facts.push(el("span", { class: "fact muted" }, `Ended: ${Words.named(record.ending)}`));
    return el("p", { class: "facts" }, facts);
  }

  function goal(scene, sample) {
    const { levels, record: { shown: as } } = sample;
    const other = as && as.goal !== sample.scene
      ? (as.goal ? `; shown was the goal of ${as.goal}` : "; no goal was shown") : "";
    return el("figure", {}, el("figcaption", {}, "Goal ", el("span", { class: "muted" },
      `${Words.count(scene.blocks.length, "block")}, level${levels.length > 1 ? "s" : ""} ${levels.join(" and ")}${other}`)),
    Stage.picture("Goal", scene.blocks, { grid: true, badges: Overlay.badges(scene) }, "goal", player));
  }

  function candidates(scene) {
    const uses = new Map();
    for (const { candidate } of scene.blocks) uses.set(candidate, (uses.get(candidate) || 0) + 1);
    const cells = scene.candidates.map((candidate, i) => {
      const n = i + 1, times = uses.get(n), name = Words.block(candidate);
      return el("li", { class: times ? "needed" : "", title: `Turned ${candidate.euler.join(", ")} degrees` },
        el("span", { class: "cell-head number" }, el("span", {}, String(n)),
          times ? el("span", { class: "cell-uses" }, `×${times}`) : null),
        Stage.picture(`Candidate ${n}: ${name}`, [Solid.onTheFloor(candidate)], { minDistance: 0 }, "cell"),
        el("span", { class: "cell-name" }, name));
    });
    return el("section", { class: "card" }, el("h2", {}, "Candidates ",
      el("span", { class: "muted" }, "framed: needed by the goal, and how often")),
    el("ol", { class: "cells" }, cells));
  }

  /** Draw everything in sight again, after a change of size or colors too. */
  function drawn(isPrinted = false) {
    Stage.draw(place, isPrinted);
    player?.tell();
  }

  function texts(sample) {
    const { record } = sample;
    if (record.turns) return [Turns.cards(record), Reply.facts(record)];
    return [Reply.card(record.reply, record.parse), Reply.facts(record)];
  }

  /** What the address keeps of it: tab, step and camera, where they are not as at first. */
  function asked() {
    const isHome = !player || player.view.every((angle, i) => angle === Stage.HOME[i]);
    return {
      tab, step: player && player.at < player.last ? player.at : "",
      view: isHome ? "" : player.view.map((angle) => Math.round(angle)).join(","),
    };
  }

  return {
    show, drawn, asked,
    /** Show a sentence in the place of a sample. */
    say: (text) => {
      shown++;
      player = null;
      document.getElementById("detail").replaceChildren(el("p", { class: "notice" }, text));
    },
    onTold: (hear) => {
      told = hear;
    },
    get player() {
      return player;
    },
  };
})();
