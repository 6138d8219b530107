/* The run's data: an index of all samples, and chunks that script tags bring when they are needed
   (a page opened from disk may not fetch). Chunks that were not used for long are dropped. */
"use strict";

const Data = (() => {
  const KEPT = 24;
  const FOLDER = document.documentElement.dataset.folder;
  const BUILD = document.documentElement.dataset.build;
  const waiting = new Map();
  const kept = new Map();
  let index = null;

  window.phyblockTake = (build, name, text) => {
    const waiter = waiting.get(name);
    if (!waiter) return;
    if (build === BUILD) waiter.settle(JSON.parse(text));
    else waiter.fail(new Error("The report was written again since this page was opened: reload it."));
  };

  function load(name) {
    if (kept.has(name)) {
      const found = kept.get(name);
      kept.delete(name);
      kept.set(name, found);
      return Promise.resolve(found);
    }
    if (waiting.has(name)) return waiting.get(name).promise;
    const waiter = {};
    waiter.promise = new Promise((settle, fail) => Object.assign(waiter, { settle, fail }));
    waiting.set(name, waiter);
    const script = document.createElement("script");
    script.src = `${FOLDER}/${name}.js`;
    script.onload = script.onerror = () => {
      script.remove();
      waiting.delete(name);
      waiter.fail(new Error(`${FOLDER}/${name}.js is not there: the folder ${FOLDER}/ belongs beside this page.`));
    };
    document.head.append(script);
    return waiter.promise.then((found) => {
      kept.set(name, found);
      if (kept.size > KEPT) kept.delete(kept.keys().next().value);
      return found;
    });
  }

  /** Number `n` of what stands in chunks of one kind: records, scenes, questions or prompts. */
  async function entry(kind, n) {
    const starts = index.starts[kind];
    let low = 0, high = starts.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (starts[middle] <= n) low = middle;
      else high = middle - 1;
    }
    return (await chunk(kind, low))[n - starts[low]];
  }

  const chunk = (kind, n) => load(`${kind}-${n}`);

  async function open() {
    index = await load("index");
    kept.delete("index");
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
    chunksKept: () => kept.size,
  };
})();
