/* The views of two tracks: a question with its pictures and options, the turns of an episode. */
"use strict";

const Question = (() => {
  const LETTERS = "ABCD";
  const isPicture = (option) => /^<img[1-4]>$/.test(option);

  /** A picture of the question: the one that was sent, where it is at hand, else drawn. */
  function picture(question, label, sample) {
    const sent = isAsEntered(question, sample) ? sample.record.prompt?.images.find((image) => image.label === label) : null;
    if (sent?.file) return Sent.picture(sent);
    const drawing = question.pictures.find((candidate) => candidate.label === label);
    if (!drawing) return null;
    const framed = drawing.framed.length ? drawing.framed : drawing.blocks;
    return el("figure", {}, Stage.picture(`Picture ${label}`, drawing.blocks,
      { view: drawing.view, framed, marks: drawing.marks, grid: true }, "goal"),
    el("figcaption", { class: "muted" }, `${label}, drawn anew`));
  }

  /** By how many places the letters of a sample are turned against those that are shown. */
  function turned(question, sample) {
    const right = sample.record.answer?.right;
    return right ? LETTERS.indexOf(question.answer[0]) - LETTERS.indexOf(right[0]) : 0;
  }

  const isAsEntered = (question, sample) => turned(question, sample) === 0
    && !sample.record.question?.wrong_image;

  /** The letters that a sample gave, as the options are lettered here. */
  function given(question, sample) {
    const letters = sample.record.answer?.given;
    if (!letters) return "";
    const n = question.options.length, by = turned(question, sample);
    return [...letters].map((letter) => LETTERS[(LETTERS.indexOf(letter) + by + n) % n] || "").join("");
  }

  /** The question as it was shown: text, pictures, options, the right one, those given. */
  function about(question, samples) {
    const [sample] = samples;
    const shown = question.pictures.filter((one) => !LETTERS.includes(one.label));
    return el("section", { class: "card question" },
      el("p", { class: "muted" }, `${question.subtask} ${Data.index.subtask_names[question.subtask] || ""} · scene ${sample.scene}`),
      el("p", { class: "asked" }, question.text),
      shown.length ? el("div", { class: "pictures" }, shown.map((one) => picture(question, one.label, sample))) : null,
      options(question, samples),
      Reply.folded("Evidence: what the right answer was worked out from", evidence(question.evidence)));
  }

  function options(question, samples) {
    const { answer } = question;
    const isOrder = answer.length > 1;
    const answers = samples.map((sample) => [samples.length > 1 ? sample.model : "", given(question, sample)]);
    return el("ol", { class: question.options.every(isPicture) ? "options pictured" : "options" }, question.options.map((option, i) => {
      const letter = LETTERS[i], isRight = !isOrder && answer === letter;
      const marks = [isOrder ? `right place ${answer.indexOf(letter) + 1}` : isRight ? "✓ right" : null];
      for (const [model, letters] of answers) {
        const by = model ? ` by ${model}` : "";
        if (isOrder && letters) marks.push(`${letters[answer.indexOf(letter)] === letter ? "✓" : "✗"} given${by} ${letters.indexOf(letter) + 1}`);
        else if (letters === letter) marks.push(`${isRight ? "✓" : "✗"} given${by}`);
      }
      const isGiven = !isOrder && answers.some(([, letters]) => letters === letter);
      return el("li", { class: [isRight && "right", isGiven && "given"].filter(Boolean).join(" ") },
        el("span", { class: "letter" }, letter),
        isPicture(option) ? picture(question, letter, samples[0]) : el("span", { class: "option" }, option),
        el("span", { class: "marks" }, marks.filter(Boolean).map((mark) => el("span", { class: "mark" }, mark))));
    }));
  }

  const isPlain = (value) => value === null || typeof value !== "object";
  const number = (value) => (typeof value === "number" && !Number.isInteger(value) ? String(Number(value.toPrecision(4)))
    : value === null ? "none" : value === true ? "yes" : value === false ? "no" : String(value).replaceAll("_", " "));

  /** Names and values as a list; what is nested is a list within. */
  function evidence(value) {
    if (isPlain(value)) return number(value);
    if (Array.isArray(value)) {
      if (value.every(isPlain)) return value.map(number).join(", ") || "none";
      return el("ol", { class: "evidence" }, value.map((one) => el("li", {}, evidence(one))));
    }
    const rows = Object.entries(value);
    return rows.length ? el("dl", { class: "evidence" }, rows.map(([name, one]) =>
      [el("dt", {}, name.replaceAll("_", " ")), el("dd", {}, evidence(one))])) : "none";
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
    return el("section", { class: "card" }, el("h2", {}, "Turns"),
      el("ol", { class: "turns" }, record.turns.map((turn) => el("li", {}, el("details", {},
        el("summary", {}, ...head(turn)),
        Reply.parsed(turn.parse),
        turn.reply?.reasoning ? Reply.folded("Reasoning", Reply.text(turn.reply.reasoning)) : null,
        Reply.text(turn.reply?.text || "(empty)"))))));
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
