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

  /** The question as it stands in the data: pictures, text, options, the right one, evidence. */
  function about(question, sample) {
    const shown = question.pictures.filter((one) => !LETTERS.includes(one.label));
    return el("section", { class: "card question" },
      el("p", { class: "muted" }, `${question.subtask} ${Data.index.subtask_names[question.subtask] || ""} · scene ${sample.scene}`),
      el("p", { class: "asked" }, question.text),
      shown.length ? el("div", { class: "pictures" }, shown.map((one) =>
        el("figure", {}, drawn(question, one.label), shown.length > 1 ? el("figcaption", { class: "muted" }, one.label) : null))) : null,
      options(question, sample),
      Detail.folded("Evidence", el("pre", { class: "text" }, JSON.stringify(question.evidence, null, 2))));
  }

  /** Options as they were shown to the model, which may have turned them round. */
  function options(question, sample) {
    const rotation = sample.record.question?.rotation || 0;
    const n = question.options.length;
    const right = sample.record.answer?.right || "";
    return el("ol", { class: "options" }, question.options.map((_, i) => {
      const from = (i + rotation) % n;
      const option = question.options[from];
      const isRight = right.length === 1 && right === LETTERS[i];
      return el("li", { class: isRight ? "right" : "" },
        el("span", { class: "letter" }, LETTERS[i]),
        isPicture(option) ? drawn(question, LETTERS[from]) : el("span", {}, option),
        isRight ? el("span", { class: "mark", title: "The right answer" }, "✓") : null);
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
        sample.outcome === "ok" ? null : el("span", { class: "chip" }, Words.named(sample.outcome))));
  }

  return { about, answer };
})();

const Turns = (() => {
  /** Every turn with what was said, folded but for its head. */
  function cards(record) {
    return el("section", { class: "card" }, el("h3", {}, "Turns"),
      el("ol", { class: "turns" }, record.turns.map((turn, i) => {
        const isPlaced = turn.outcome === "placed";
        return el("li", {}, el("details", {},
          el("summary", {}, el("span", { class: "number" }, `${i + 1}`),
            el("span", { class: `verdict ${isPlaced ? "right" : "wrong"}` },
              `${isPlaced ? "✓" : "✗"} ${Words.named(turn.outcome)}`),
            el("span", { class: "muted" }, turn.parse && turn.parse.move !== null ? `said ${turn.parse.move}` : "")),
          Detail.parsed(turn.parse),
          turn.reply?.reasoning ? Detail.folded("Reasoning", el("pre", { class: "text" }, turn.reply.reasoning)) : null,
          el("pre", { class: "text reply" }, turn.reply?.text || "(empty)"),
          turn.feedback ? el("p", { class: "muted" }, turn.feedback) : null,
          Detail.promptCard(turn.prompt)));
      })));
  }

  return { cards };
})();
