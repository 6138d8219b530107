/* The page's data: the numbers that are in it, and beside it, in scripts that are loaded when they
   are needed, the index of all samples and what is shown of each. A page that was opened from disk
   may not fetch. Scripts that were not used for long are dropped. */
"use strict";

const Data = (() => {
  const MOST_KEPT = 24;
  const { folder, build } = document.documentElement.dataset;
  const board = JSON.parse(document.getElementById("board").textContent);
  const isSite = !board.tables;
  const waiting = new Map();
  const kept = new Map();
  let index = null;

  window.phyblockTake = (builtAs, name, data) => {
    const waiter = waiting.get(name);
    if (!waiter) return;
    if (builtAs === build) waiter.settle(unpacked(data));
    else waiter.fail(new Error("The page was written again since it was opened: reload it."));
  };

  /** JSON, deflated, in base 64. */
  async function unpacked(packed) {
    const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return JSON.parse(await new Response(stream).text());
  }

  function load(name) {
    // A script that was dropped while it is under way is waited for together.
    const found = kept.get(name) || waiting.get(name)?.found || fetched(name);
    // The last one is the one that was used last.
    kept.delete(name);
    kept.set(name, found);
    if (kept.size > MOST_KEPT) kept.delete(kept.keys().next().value);
    return found;
  }

  function fetched(name) {
    const waiter = {};
    waiter.found = new Promise((settle, fail) => Object.assign(waiter, { settle, fail }));
    waiting.set(name, waiter);
    const script = document.createElement("script");
    script.src = `${folder}/${name}.js`;
    script.onload = script.onerror = () => {
      script.remove();
      waiting.delete(name);
      waiter.fail(new Error(`${folder}/${name}.js is not there: the folder ${folder}/ belongs beside this page.`));
    };
    document.head.append(script);
    waiter.found.catch(() => kept.delete(name));
    return waiter.found;
  }

  /** Number `n` of the records, scenes, questions or prompts. */
  async function entry(kind, n) {
    const starts = index.starts[kind];
    let low = 0, high = starts.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (starts[middle] <= n) low = middle;
      else high = middle - 1;
    }
    return (await load(`${kind}-${low}`))[n - starts[low]];
  }

  /** The index of all samples; read when it is first needed. */
  async function open() {
    if (index) return index;
    index = await load("samples");
    Solid.setKit(index.kit.shapes, index.kit.colors);
    index.rowsOfItem = grouped(index.rows.item, index.items.key.length);
    index.rowsOfEntry = grouped(index.rows.entry, board.rows.length);
    return index;
  }

  function grouped(column, count) {
    const found = Array.from({ length: count }, () => []);
    column.forEach((value, row) => found[value].push(row));
    return found;
  }

  /** The facts of sample `row` that the index has. */
  function sample(row) {
    const { rows, items } = index;
    const item = rows.item[row], entry = board.rows[rows.entry[row]];
    const track = board.tracks.find(({ name }) => name === index.tracks[items.track[item]]);
    const [seed, way] = [rows.seed[row], index.ways[rows.way[row]]];
    const asked = [board.runs[entry.runs[track.name]].seeds > 1 && `seed ${seed}`, way];
    return {
      row, item, track, entry, seed, way, key: items.key[item], sceneNumber: items.scene[item],
      scene: index.scenes[items.scene[item]], levels: items.levels[item], part: items.part[item],
      question: items.question[item], outcome: index.outcomes[rows.outcome[row]], score: rows.score[row],
      id: [track.name, entry.name, items.key[item], `s${seed}`, way].filter(Boolean).join("/"),
      name: [entry.name, ...asked.filter(Boolean)].join(" · "),
    };
  }

  /** The number of the sample with this id, or -1. */
  function find(id) {
    const { items, rows } = index;
    // Most rows are told apart by their item, which is quicker than the whole name.
    return rows.item.findIndex((item, row) => id.includes(items.key[item]) && sample(row).id === id);
  }

  const scene = (n) => (index.starts.scenes.length ? entry("scenes", n) : null);

  /** Why a track, or a model in it, has no sample at all; "" where there is one. */
  function lacking(track, place = -1) {
    const { rows, items, tracks } = index;
    const isOf = (row) => tracks[items.track[rows.item[row]]] === track.name;
    const all = place < 0 ? rows.item.map((_, row) => row) : index.rowsOfEntry[place];
    if (all.some(isOf)) return "";
    if (place < 0) return ["There is no sample here.", ...(board.cautions || [])].join(" ");
    const { name, lacking: why } = board.rows[place];
    return `There is no sample of ${name} here${why[track.name] ? `: ${why[track.name]}` : ""}.`;
  }

  const isModel = (row) => row.kind !== "baseline";
  const trackOf = (name) => board.tracks.find((one) => one.name === name) || board.tracks[0];
  /** The column that models are ranked by in a track, and those of single levels beside it. */
  const mainOf = (track) => board.columns.find((one) => one.track === track.name && one.heading === track.main);
  const levelsOf = (track) => board.columns.filter((one) => one.track === track.name
    && one.setting === mainOf(track).setting && /^Level \d$/.test(one.heading));

  /** For sorting by scores of a track, the worst first: none, then what its measure calls worse. */
  function worse(a, b, track) {
    if (a === null || b === null) return (a !== null) - (b !== null);
    return track.better === "lower" ? b - a : a - b;
  }

  return {
    board, isSite, open, load, entry, scene, sample, find, lacking, isModel, trackOf, mainOf, levelsOf, worse,
    get index() {
      return index;
    },
  };
})();
