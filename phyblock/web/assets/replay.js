/* A sample again: the goal, what was built step by step, the reply; beside it another model's. */
"use strict";

const Replay = (() => {
  let player = null;

  /** Draw all that is in a place, after a change of size or colors too. */
  function draw(place) {
    Stage.draw(place);
    player?.tell();
  }

  function stop() {
    player?.stop();
    player = null;
  }

  async function view(words) {
    await Store.openSamples();
    const sample = find(words.get("m"), words);
    if (!sample) return Views.unknown("sample", [words.get("m"), words.get("i")].filter(Boolean).join(", "));
    const other = words.get("b") ? find(words.get("b"), words) : null;
    const shown = [sample, ...(other && other.row !== sample.row ? [other] : [])];
    const records = await Promise.all(shown.map(({ row }) => Store.entry("replays", row)));
    const inFile = Store.index.starts.scenes.length ? await Store.entry("scenes", sample.sceneNumber) : null;
    const question = sample.question >= 0 ? await Store.entry("questions", sample.question) : null;
    const settings = [...new Set(records.flatMap((record) => (record.scores || []).map((score) => score.setting)))];
    const setting = settings.includes(words.get("g")) ? words.get("g") : settings[0] || "A";
    const isQuestion = sample.part !== null;
    const scene = inFile && Steps.asShown(inFile, records[0]);
    stop();
    return [
      Views.crumbs([["board", {}, "Ranking"], ["scenes", {}, "Scenes"], ["scene", { s: sample.scene }, sample.scene]]),
      el("h1", {}, sample.key, " ", el("span", { class: "muted" }, sample.entry.name)),
      tools(words, sample, other, settings, setting),
      question ? asked(question, sample, records[0]) : null,
      isQuestion ? null : assembly(shown, records, scene, setting),
      el("div", { class: shown.length > 1 ? "columns two" : "columns" }, shown.map((one, i) => el("div", {}, said(one, records[i], isQuestion, shown.length > 1)))),
    ].filter(Boolean);
  }

  /** The sample of an entry that the words name. */
  function find(name, words) {
    const { index, board } = Store;
    const entry = board.rows.findIndex((row) => row.name === name);
    if (entry < 0) return null;
    for (const row of index.rowsOfEntry[entry]) {
      const item = index.rows.item[row];
      if (index.items.key[item] !== words.get("i") || index.tracks[index.items.track[item]] !== words.get("t")) continue;
      if (String(index.rows.seed[row]) === (words.get("n") || "0") && index.ways[index.rows.way[row]] === (words.get("w") || "")) return Store.sample(row);
    }
    return null;
  }

  function tools(words, sample, other, settings, setting) {
    const alike = Store.index.rowsOfItem[sample.item].map(Store.sample);
    const again = alike.filter((one) => one.entry === sample.entry);
    const rivals = alike.filter((one) => one.entry !== sample.entry && one.seed === sample.seed && one.way === sample.way);
    const choose = (changes) => Site.go("replay", { ...Site.wordsOf(sample), g: words.get("g"), b: words.get("b"), ...changes });
    const choice = (id, name, options) => el("label", { class: "choice" }, el("span", {}, name), el("select", { id, onchange: (event) => options.find(([value]) => value === event.target.value)[2]() },
      options.map(([value, shown, , isOn]) => el("option", { value, selected: isOn }, shown))));
    return el("div", { class: "tools" },
      choice("model", "Model", [sample, ...rivals].sort((a, b) => a.entry.name.localeCompare(b.entry.name)).map((one) => [
        one.entry.name, one.entry.name, () => choose({ m: one.entry.name, b: words.get("b") === one.entry.name ? "" : words.get("b") }), one === sample])),
      rivals.length ? choice("beside", "Beside it", [["", "Nothing", () => choose({ b: "" }), !other],
        ...rivals.map((one) => [one.entry.name, one.entry.name, () => choose({ b: one.entry.name }), one.entry === other?.entry])]) : null,
      again.length > 1 ? choice("again", "Asked again", again.map((one) => {
        const name = [`seed ${one.seed}`, one.way].filter(Boolean).join(", ");
        return [String(one.row), name, () => Site.go("replay", { ...Site.wordsOf(one), g: words.get("g"), b: words.get("b") }), one.row === sample.row];
      })) : null,
      settings.length > 1 ? choice("setting", "Setting", settings.map((name) => [name, name === "A" ? "A: with orientation" : name === "B" ? "B: without orientation" : name, () => choose({ g: name }), name === setting])) : null);
  }

  const scoreOf = (record, setting) => (record.scores || []).find((score) => score.setting === setting && score.placed);

  function assembly(samples, records, scene, setting) {
    const several = samples.length > 1;
    const runs = records.map((record) => Runs.of(scene, record, setting, scoreOf(record, setting)));
    const longest = Math.max(...runs.map(({ steps }) => steps.length));
    const noun = records[0].turns ? "Turn" : "Step";
    player = new Stage.Player(longest + 1, Stage.wrongSteps(runs));
    const panels = runs.map((run) => (run.steps.length ? Stage.panel(run, player, noun, scene) : null));
    const isWide = runs.some(({ titles }) => titles.length > 1);
    const caption = (i, title) => (several ? `${samples[i].entry.name}${isWide ? `: ${title.toLowerCase()}` : ""}` : title);
    const told = panels.map((panel, i) => [several ? el("h2", { class: "model-name" }, samples[i].entry.name) : null,
      facts(samples[i], records[i], setting), panel ? panel.said : nothing(samples[i], records[i]),
      panel ? Why.note({ record: records[i] }, scene, runs[i].steps, player) : null]);
    return el("section", { class: "card", "aria-label": "Replay" },
      scene ? null : el("p", { class: "notice" }, Store.index.lacking || "The scene is not at hand, so that nothing can be drawn."),
      el("div", { class: ["sides", several && "two", isWide && "wide"].filter(Boolean).join(" ") },
        scene ? el("figure", {}, el("figcaption", {}, "Goal"), Stage.picture("Goal", scene.blocks, { grid: true, badges: Overlay.badges(scene) }, "goal", player)) : null,
        panels.map((panel, i) => [
          (panel?.pictures || []).map(({ title, canvas }) => el("figure", { class: "built" }, el("figcaption", {}, caption(i, title)), canvas)),
          several ? null : el("div", { class: "about-step" }, told[i])])),
      several ? el("div", { class: "columns two" }, told.map((parts) => el("div", {}, parts))) : null,
      longest ? Stage.controls(player, noun) : null,
      panels.map((panel, i) => panel && [several ? el("p", { class: "muted strip-of" }, samples[i].entry.name) : null, panel.strip]).flat());
  }

  function facts(sample, record, setting) {
    const score = scoreOf(record, setting);
    const known = [];
    if (sample.outcome !== "ok") known.push(el("span", { class: "chip" }, Words.named(sample.outcome)));
    if (score) {
      const whole = 2 * score.tp + score.fp + score.fn;
      const all = [["F1", Words.percent(whole ? (2 * score.tp) / whole : null)], ["Right", score.tp], ["Wrong", score.fp], ["Left out", score.fn]];
      known.push(...all.map(([name, value]) => el("span", { class: "fact" }, `${name} `, el("b", { class: "number" }, String(value)))));
    } else if (sample.score !== null) known.push(el("span", { class: "fact" }, "Score ", el("b", { class: "number" }, Table.text(sample.score))));
    for (const [name, value] of record.pose ? Poses.facts(record) : []) known.push(el("span", { class: "fact" }, `${name} `, el("b", { class: "number" }, value)));
    if (record.ending) known.push(el("span", { class: "fact muted" }, `Ended: ${Words.named(record.ending)}`));
    return el("p", { class: "facts" }, known);
  }

  function nothing(sample, record) {
    if (sample.outcome === "ok" && !record.parse?.plan) return null;
    const why = record.error ? record.error.message : record.reply ? "No plan could be read in the reply." : "There is no reply.";
    return el("p", { class: "notice" }, why);
  }

  const LETTERS = "ABCD";
  const isPicture = (option) => /^<img[1-4]>$/.test(option);

  /** A question as it was shown, with the answer that is right and the one that was given. */
  function asked(question, sample, record) {
    const drawn = (one) => Stage.picture(`Picture ${one.label}`, one.blocks, { view: one.view, framed: one.framed.length ? one.framed : one.blocks, marks: one.marks, grid: true });
    const given = record.answer?.given ?? "";
    const shown = question.pictures.filter((one) => !LETTERS.includes(one.label));
    return el("section", { class: "card question", "aria-label": "Question" },
      el("p", { class: "muted" }, `${question.subtask} ${Store.index.parts[question.subtask] || ""} · scene ${sample.scene}`),
      el("p", { class: "asked" }, question.text),
      shown.length ? el("div", { class: "pictures" }, shown.map((one) => el("figure", {}, drawn(one), shown.length > 1 ? el("figcaption", { class: "muted" }, one.label) : null))) : null,
      el("ol", { class: question.options.every(isPicture) ? "options pictured" : "options" }, question.options.map((option, i) => {
        const letter = LETTERS[i];
        const isRight = question.answer === letter;
        const marks = [isRight && "✓ right", given === letter && "given", question.answer.length > 1 && `place ${question.answer.indexOf(letter) + 1}`].filter(Boolean);
        const one = question.pictures.find((candidate) => candidate.label === letter);
        return el("li", { class: isRight ? "right" : "" }, el("span", { class: "letter" }, letter),
          isPicture(option) && one ? drawn(one) : el("span", {}, option), marks.length ? el("span", { class: "mark" }, marks.join(", ")) : null);
      })));
  }

  function said(sample, record, isQuestion, several) {
    const turns = record.turns || [];
    const cards = [];
    if (several && isQuestion) cards.push(el("h2", { class: "model-name" }, sample.entry.name));
    if (record.answer) {
      const { right, given, correct } = record.answer;
      cards.push(el("section", { class: "card" }, el("p", { class: "facts" },
        el("span", { class: `verdict ${correct ? "right" : "wrong"}` }, correct ? "✓ Right" : "✗ Wrong"),
        el("span", { class: "fact" }, "Answered ", el("b", {}, given ?? "nothing")), el("span", { class: "fact" }, "Right is ", el("b", {}, right)))));
    }
    if (turns.length) {
      cards.push(el("section", { class: "card" }, el("h2", {}, "Turns"), el("ol", { class: "turns" }, turns.map((turn) => el("li", {}, el("details", {},
        el("summary", {}, el("span", { class: "number" }, String(turn.n)), el("span", {}, turn.outcome === null ? "outvoted" : Words.named(turn.outcome))),
        reply(turn.reply)))))));
    } else if (record.reply) {
      cards.push(el("section", { class: "card" }, el("h2", {}, "Reply"), reply(record.reply)));
    } else {
      cards.push(el("section", { class: "card" }, el("h2", {}, "Reply"), nothing(sample, record)));
    }
    return cards;
  }

  function reply(found) {
    const cut = (name) => (found[`${name}_characters`]
      ? el("p", { class: "muted" }, `Cut here: it goes on to ${found[`${name}_characters`].toLocaleString("en")} characters.`) : null);
    const usage = found.usage || {};
    const took = [usage.prompt_tokens && `${usage.prompt_tokens.toLocaleString("en")} tokens in`, usage.completion_tokens && `${usage.completion_tokens.toLocaleString("en")} out`,
      found.cost_usd && `$${Table.dollars(found.cost_usd)}`, found.latency_s && `${found.latency_s.toFixed(1)} s`].filter(Boolean);
    return [found.reasoning ? el("details", {}, el("summary", {}, "Reasoning"), el("pre", { class: "text" }, found.reasoning), cut("reasoning")) : null,
      el("pre", { class: "text reply" }, found.text || "(empty)"), cut("text"), took.length ? el("p", { class: "muted number" }, took.join(", ")) : null];
  }

  return { view, draw, stop, get player() {
    return player;
  } };
})();
