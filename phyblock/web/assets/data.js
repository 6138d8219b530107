/* The run's data: an index of all samples, and what is brought of each when it is looked at. */
"use strict";

const Data = (() => {
  const chunks = chunksOf({ noun: "report", most: 24 });
  let index = null;

  /** Number `n` of the records, scenes, questions or prompts. */
  const entry = (kind, n) => chunks.entry(index.starts[kind], kind, n);

  const chunk = (kind, n) => chunks.load(`${kind}-${n}`);

  async function open() {
    index = await chunks.load("index");
    Solid.setKit(index.kit.shapes, index.kit.colors);
    return index;
  }

  /** What the index knows of sample `row`. */
  function sample(row) {
    const { rows, items } = index;
    const item = rows.item[row];
    const scores = {};
    for (const [setting, columns] of Object.entries(rows.scores)) {
      if (columns.tp[row] === null) continue;
      const [tp, fp, fn] = [columns.tp[row], columns.fp[row], columns.fn[row]];
      const whole = 2 * tp + fp + fn;
      scores[setting] = { tp, fp, fn, wrong: columns.wrong[row], f1: whole ? (2 * tp) / whole : null };
    }
    const found = {
      row, item, scores,
      track: index.tracks[rows.track[row]], model: index.models[rows.model[row]],
      key: items.key[item], scene: index.scenes[items.scene[item]], levels: items.levels[item],
      sceneNumber: items.scene[item], question: items.question[item], subtask: items.subtask[item],
      seed: rows.seed[row], outcome: index.outcomes[rows.outcome[row]], correct: rows.correct[row],
    };
    found.variant = index.variants[rows.variant[row]];
    found.id = `${found.track}/${found.model}/${found.key}/s${found.seed}${found.variant && `/${found.variant}`}`;
    const said = [index.seeds.length > 1 && `seed ${found.seed}`, found.variant];
    found.asked = [found.model, ...said.filter(Boolean)].join(" · ");
    return found;
  }

  /** The number of the sample with this id, or -1. */
  function find(id) {
    const { items, rows, scenes } = index;
    const n = rows.item.length;
    for (let row = 0; row < n; row++) {
      // Most rows are told apart by their item, which is quicker than the whole name.
      if (id.includes(items.key[rows.item[row]] || scenes[items.scene[rows.item[row]]]) && sample(row).id === id) return row;
    }
    return -1;
  }

  /** Why a track, or a model in it, has no sample at all; "" where there is one. */
  function lacking(track, model) {
    const { rows, models, cautions, shortfalls } = index;
    if (rows.track.some((of, row) => of === track && (model === undefined || rows.model[row] === model))) return "";
    if (model === undefined) return ["There is no sample here.", ...cautions].join(" ");
    const why = shortfalls[index.tracks[track]]?.[models[model]];
    return `There is no sample of ${models[model]} here${why ? `: ${why}` : ""}.`;
  }

  return {
    open, sample, find, entry, chunk, lacking,
    get index() {
      return index;
    },
    chunksKept: chunks.count,
  };
})();
