/* One sample, whole: what it built or answered, beside it the same of another model; what the model
   saw, and what it said. */
"use strict";

const Sample = (() => {
  const LETTERS = "ABCD";
  const isPicture = (option) => /^<img[1-4]>$/.test(option);
  const folded = (title, ...children) => el("details", {}, el("summary", {}, title), children);
  const card = (title, ...children) => el("section", { class: "card" }, title && el("h2", {}, title), children);
  let player = null;

  /** The parts of sample `row`, beside it of `other` where one is given (-1: none). */
  async function parts(row, other, wanted) {
    const samples = await Promise.all([row, other].filter((n) => n >= 0).map(async (n) =>
      ({ ...Data.sample(n), record: await Data.entry("records", n) })));
    const [first] = samples;
    const scene = Steps.asShown(await Data.scene(first.sceneNumber), first.record);
    const question = first.question >= 0 ? await Data.entry("questions", first.question) : null;
    const setting = settingsOf(first.record).includes(wanted) ? wanted : settingsOf(first.record)[0] || "A";
    player?.stopAt(player.at);
    player = null;
    const isSeveral = samples.length > 1;
    const heading = (sample) => (isSeveral ? el("p", { class: "model-name" }, sample.name) : null);
    return [
      question ? asked(question, samples) : assembly(samples, scene, setting, heading),
      columns(samples.map((sample) => [heading(sample), ...said(sample)])),
      question || !scene ? null : candidates(scene),
      el("details", { class: "card sent" }, el("summary", {}, "What the model saw"),
        columns(samples.map((sample) => [heading(sample), sent(sample)]))),
    ].filter(Boolean);
  }

  /** Settings that a plan was scored in. */
  const settingsOf = (record) => (record.pose || record.turns ? [] : record.scores.map((score) => score.setting));

  const columns = (contents) => el("div", { class: contents.length > 1 ? "columns two" : "columns" },
    contents.map((children) => el("div", {}, children)));

  // ---- the build

  /** Goal and builds side by side, under one clock; the steps below. */
  function assembly(samples, scene, setting, heading) {
    const runs = samples.map(({ record }) => Steps.of(scene, record, setting));
    const longest = Math.max(...runs.map(({ steps }) => steps.length));
    const noun = samples[0].record.turns ? "Turn" : "Step";
    player = new Stage.Player(longest + 1, Stage.wrongSteps(runs));
    const panels = runs.map((run, i) => Stage.panel(run, player, noun, scene, Quotes.of(samples[i].record, run.steps)));
    const told = panels.map((panel, i) => [heading(samples[i]), facts(samples[i], setting),
      runs[i].steps.length ? panel.said : nothing(samples[i])]);
    const isSeveral = samples.length > 1;
    const built = panels.flatMap(({ pictures }, i) => (runs[i].steps.length ? pictures : []).map(({ title, canvas }) =>
      el("figure", { class: "built" }, el("figcaption", {}, isSeveral ? `${samples[i].name}: ${title.toLowerCase()}` : title), canvas)));
    const goal = scene && el("figure", {}, el("figcaption", {}, "Goal ", el("span", { class: "muted" }, about(scene, samples[0]))),
      Stage.picture("Goal", [scene.blocks, { badges: scene.blocks.map((one) => Steps.badge(scene, one)) }], player));
    return el("section", { class: "card", "aria-label": "What it built" },
      scene ? null : el("p", { class: "notice" }, Data.index.lacking || "The data set has no such scene."),
      el("div", { class: `sides n${built.length}${isSeveral ? " two" : ""}` }, goal, built,
        isSeveral ? null : el("div", { class: "told" }, told[0])),
      isSeveral ? columns(told) : null,
      longest ? Stage.controls(player, noun) : null,
      panels.map(({ strip }, i) => [heading(samples[i]), strip]).flat());
  }

  function about(scene, { levels, record, entry }) {
    const words = [Words.count(scene.blocks.length, "block"), `level${levels.length > 1 ? "s" : ""} ${levels.join(" and ")}`];
    const { shown } = record;
    if (shown?.blind) words.push("no goal was shown");
    else if (entry.kind === "replay") words.push("redrawn");
    return words.join(", ");
  }

  /** Why there is nothing on the stage. */
  function nothing({ outcome, record }) {
    if (outcome === "ok" && !record.parse?.plan && !record.turns) return null;
    const problem = record.parse?.problem ? `: ${Words.named(record.parse.problem)}` : "";
    const why = record.error ? record.error.message
      : record.reply ? `Nothing could be parsed from the reply${problem}.` : "There is no reply.";
    return el("p", { class: "notice" }, why);
  }

  const fact = (name, value) => el("span", { class: "fact" }, `${name} `, el("b", { class: "number" }, String(value)));
  const chip = (outcome) => (outcome === "ok" ? null : el("span", { class: "chip" }, Words.named(outcome)));

  /** Counts and scores of a sample in one line. */
  function facts({ record, outcome, score: worth, track }, setting) {
    const score = record.pose || record.turns ? null : Steps.scoreOf(record, setting);
    const all = record.pose ? Poses.facts(record) : worth === null ? [] : [[track.main.replace("Overall ", ""), Words.number(worth)]];
    if (score) {
      const whole = 2 * score.tp + score.fp + score.fn;
      all.splice(0, 1, ["F1", Words.number(whole ? (200 * score.tp) / whole : null)],
        ["Right", score.tp], ["Wrong", score.fp], ["Left out", score.fn]);
    }
    return el("p", { class: "facts" }, chip(outcome), all.map(([name, value]) => fact(name, value)),
      score ? el("span", { class: "muted" }, `Setting ${score.setting}`) : null,
      record.ending ? el("span", { class: "muted" }, `Ended: ${Words.named(record.ending)}`) : null);
  }

  function candidates(scene) {
    const uses = new Map();
    for (const { candidate } of scene.blocks) uses.set(candidate, (uses.get(candidate) || 0) + 1);
    return card("Candidates", el("p", { class: "muted" }, "Framed: needed by the goal, and how often."),
      el("ol", { class: "cells" }, scene.candidates.map((one, i) => {
        const times = uses.get(i + 1);
        return el("li", { class: times ? "needed" : "", title: `Turned ${one.euler.join(", ")} degrees` },
          el("span", { class: "cell-head number" }, el("b", {}, String(i + 1)), times ? el("span", {}, `×${times}`) : null),
          Stage.candidate(one, i + 1), el("span", { class: "cell-name" }, Words.block(one)));
      })));
  }

  // ---- a question

  /** The question as it was shown: text, pictures, options, the right one, those given. */
  function asked(question, samples) {
    const [sample] = samples;
    const shown = question.pictures.filter((one) => !LETTERS.includes(one.label));
    return el("section", { class: "card question", "aria-label": "Question" },
      el("p", { class: "muted" }, `${question.subtask} ${sample.track.parts[question.subtask] || ""} · scene ${sample.scene}`),
      el("p", { class: "asked" }, question.text),
      shown.length ? el("div", { class: "pictures" }, shown.map((one) => pictureOf(question, one.label, sample))) : null,
      el("ol", { class: question.options.every(isPicture) ? "options pictured" : "options" },
        question.options.map((option, i) => optionOf(question, samples, option, LETTERS[i]))),
      folded("Evidence: what the right answer was computed from", evidence(question.evidence)));
  }

  /** A picture of the question: the one that was sent, where it is at hand, else drawn. */
  function pictureOf(question, label, { record }) {
    const isAsEntered = turned(question, record) === 0;
    const image = isAsEntered ? record.prompt?.images.find((one) => one.label === label) : null;
    if (image?.file) return sentPicture(image);
    const { blocks, framed, marks, view } = question.pictures.find((one) => one.label === label) || {};
    if (!blocks) return null;
    return el("figure", {}, Stage.picture(`Picture ${label}`, [blocks, { view, framed: framed.length ? framed : blocks, marks }]),
      el("figcaption", { class: "muted" }, `${label}, redrawn`));
  }

  /** By how many places the letters of a sample are turned against those that are shown. */
  function turned(question, { answer }) {
    return answer?.right ? LETTERS.indexOf(question.answer_letters[0]) - LETTERS.indexOf(answer.right[0]) : 0;
  }

  /** The letters that a sample gave, as the options are lettered here. */
  function given(question, record) {
    const n = question.options.length, by = turned(question, record);
    return [...record.answer?.given || ""].map((letter) => LETTERS[(LETTERS.indexOf(letter) + by + n) % n] || "").join("");
  }

  function optionOf(question, samples, option, letter) {
    const { answer_letters: answer } = question, isOrder = answer.length > 1, isRight = answer === letter;
    const marks = [isOrder ? `right place ${answer.indexOf(letter) + 1}` : isRight ? "✓ right" : null];
    for (const { record, name } of samples) {
      const letters = given(question, record), by = samples.length > 1 ? ` by ${name}` : "";
      const isFit = isOrder ? letters[answer.indexOf(letter)] === letter : isRight;
      const said = isOrder ? letters.includes(letter) && ` ${letters.indexOf(letter) + 1}` : letters === letter && "";
      if (said !== false) marks.push(`${isFit ? "✓" : "✗"} given${by}${said}`);
    }
    return el("li", { class: isRight ? "right" : "" }, el("b", {}, letter),
      isPicture(option) ? pictureOf(question, letter, samples[0]) : el("span", { class: "option" }, option),
      el("span", { class: "marks" }, marks.filter(Boolean).map((mark) => el("span", { class: "mark" }, mark))));
  }

  const isPlain = (value) => value === null || typeof value !== "object";
  const plain = (value) => (typeof value === "number" && !Number.isInteger(value) ? String(Number(value.toPrecision(4)))
    : { null: "none", true: "yes", false: "no" }[value] || Words.named(value));

  /** Names and values as a list; a nested value is a list within. */
  function evidence(value) {
    if (isPlain(value)) return plain(value);
    if (Array.isArray(value)) {
      if (value.every(isPlain)) return value.map(plain).join(", ") || "none";
      return el("ol", {}, value.map((one) => el("li", {}, evidence(one))));
    }
    return listOf(Object.entries(value).map(([name, one]) => [Words.named(name), evidence(one)]), "pairs");
  }

  // ---- the reply

  /** Fields that say how a reply was read, not what was read in it. */
  const HOW_READ = ["rule", "parser", "problem", "dropped", "letters", "move", "plan"];

  /** The cards of a reply: the answer and whether it is right, the text, facts of the call. */
  function said({ record, outcome }) {
    const { reply, parse, turns, answer, error } = record;
    const cards = [answer ? verdict(answer, outcome, record.question) : null];
    if (turns) {
      cards.push(card("Turns", el("ol", { class: "turns" }, turns.map((turn) => el("li", {}, el("details", {},
        el("summary", {}, turnHead(turn)), readIn(turn.parse), texts(turn.reply)))))));
    } else if (reply) cards.push(card("Reply", readIn(parse), texts(reply)));
    else if (error) cards.push(card("Reply", el("p", { class: "notice" }, `${error.kind} ${error.status ?? ""}: ${error.message}`)));
    if (reply) cards.push(card(null, callFacts(reply)));
    return cards.filter(Boolean);
  }

  function verdict({ correct, given: letters, right }, outcome, shown) {
    const notes = [shown?.rotation && `options rotated by ${shown.rotation}`, shown?.blind && "sent without pictures"].filter(Boolean);
    return el("section", { class: "card answer" }, el("p", { class: "facts" },
      el("span", { class: `verdict ${correct ? "right" : "wrong"}` }, correct ? "✓ Right" : "✗ Wrong"),
      fact("Answered", letters ?? "nothing"), fact("Right is", right),
      notes.length ? el("span", { class: "muted" }, notes.join("; ")) : null, chip(outcome)));
  }

  function turnHead(turn) {
    const move = turn.parse?.move ?? "", isPlaced = turn.outcome === "placed";
    const became = el("span", { class: `verdict ${isPlaced ? "right" : "wrong"}` }, `${isPlaced ? "✓" : "✗"} ${Words.named(turn.outcome)}`);
    return [el("span", { class: "number" }, String(turn.n)), became, el("span", { class: "muted" }, move && `said ${move}`)];
  }

  function readIn(parse) {
    if (!parse) return null;
    const [one] = [parse.plan, parse.letters, parse.move].filter((value) => value !== null && value !== undefined);
    const others = Object.entries(parse).filter(([name, value]) => !HOW_READ.includes(name) && value !== null);
    const values = one === undefined ? others.map(([name, value]) => `${Words.named(name)} ${isPlain(value) ? value : JSON.stringify(value)}`).join(", ")
      : Array.isArray(one) ? one.join(" → ") : String(one);
    const how = [parse.rule ? `read by the rule ${parse.rule}` : values ? "" : "nothing could be read",
      parse.dropped?.length ? `dropped, no such candidate: ${parse.dropped.join(", ")}` : "", parse.parser && `parser ${parse.parser}`];
    return el("p", { class: "parsed" }, el("b", { class: "number plan" }, values),
      el("span", { class: "muted" }, ` ${how.filter(Boolean).join("; ")}`));
  }

  function texts(reply) {
    if (!reply) return null;
    const text = (name) => el("pre", { class: "text reply", tabindex: 0 }, reply[name] || "(empty)");
    return [reply.reasoning ? folded("Reasoning", text("reasoning")) : null, text("text")];
  }

  function callFacts({ usage = {}, ...reply }) {
    const tokens = (name) => usage[name]?.toLocaleString("en");
    return listOf([
      ["Finish", reply.finish], ["Tokens in", tokens("prompt_tokens")], ["Tokens out", tokens("completion_tokens")],
      ["Tokens reasoning", tokens("reasoning_tokens")], ["Cost", reply.cost_usd === undefined ? "unknown" : `$${reply.cost_usd.toFixed(4)}`],
      ["Latency", reply.attempts ? `${reply.latency_s.toFixed(2)} s` : null], ["Requests", reply.attempts || null],
      ["From the cache", reply.cached ? "yes" : null], ["Answered by", reply.provider_model],
    ]);
  }

  // ---- the prompt

  /** The prompt and pictures as they were sent; of an episode turn by turn. */
  function sent({ record, entry }) {
    const turns = (record.turns || []).filter((turn) => turn.prompt);
    if (turns.length) {
      return el("ol", { class: "turns" }, turns.map((turn, i) => el("li", {}, el("details", { open: i === 0 },
        el("summary", {}, `Turn ${turn.n}`), prompt(turn.prompt)))));
    }
    if (record.prompt) return prompt(record.prompt);
    const why = Data.isSite ? "A leaderboard holds no prompts; the report of the run has them."
      : { replay: `Nothing was sent in this run: the reply of ${entry.name} is a recording without its prompt.`,
        baseline: `Nothing was sent: ${entry.name} is a rule, not a model.` }[entry.kind] || "No prompt was sent, or it was not kept.";
    return el("p", { class: "notice" }, why);
  }

  function prompt({ n, images, template }) {
    const body = el("div", { class: "prompt" });
    const fill = async () => {
      if (n === null) return [el("p", { class: "muted" }, `Template ${template}; the text was not kept.`), images.map(sentPicture)];
      return (await Data.entry("prompts", n)).map(({ role, parts }) => [el("p", { class: "muted" }, role),
        parts.map((part) => (typeof part === "string" ? el("pre", { class: "text" }, part)
          : sentPicture(images.find(({ label }) => label === part.image) || { label: part.image })))]);
    };
    fill().then((made) => body.append(...made.flat(Infinity)), (error) => body.append(error.message));
    return body;
  }

  /** A picture with the bytes that were sent, or word that they are not at hand. */
  function sentPicture({ label, file, width_px: width, height_px: height }) {
    const size = width ? `, ${width} × ${height} pixels` : "";
    if (!file) return el("p", { class: "notice" }, `Picture “${label}”${size}: it was sent, and is not kept beside this page.`);
    return el("figure", {}, el("img", { src: file, alt: `Picture as sent: ${label}`, width, height }),
      el("figcaption", { class: "muted" }, `${label}${size}, as sent`));
  }

  return { parts, settingsOf, candidates,
    get player() {
      return player;
    } };
})();
