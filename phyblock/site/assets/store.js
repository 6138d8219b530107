/* The site's data: scripts that hold packed JSON, brought when they are needed. */
"use strict";

const Store = (() => {
  const { folder: FOLDER, build: BUILD } = document.documentElement.dataset;
  const KEPT = 16;
  const waiting = new Map();
  const kept = new Map();
  let board = null;
  let index = null;

  async function unpacked(packed) {
    const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return JSON.parse(await new Response(stream).text());
  }

  window.phyblockSite = (build, name, packed) => {
    const waiter = waiting.get(name);
    if (!waiter) return;
    if (build === BUILD) waiter.settle(unpacked(packed));
    else waiter.fail(new Error("The site was written again since this page was opened: reload it."));
  };

  function load(name) {
    if (kept.has(name)) {
      const found = kept.get(name);
      kept.delete(name);
      kept.set(name, found);
      return found;
    }
    const found = new Promise((settle, fail) => waiting.set(name, { settle, fail }));
    const script = document.createElement("script");
    script.src = `${FOLDER}/${name}.js`;
    script.onload = script.onerror = () => {
      const waiter = waiting.get(name);
      script.remove();
      waiting.delete(name);
      waiter.fail(new Error(`${FOLDER}/${name}.js is not there: the folder data/ belongs beside this page.`));
    };
    document.head.append(script);
    kept.set(name, found);
    found.catch(() => kept.delete(name));
    if (kept.size > KEPT) kept.delete(kept.keys().next().value);
    return found;
  }

  /** The numbers of the first page. */
  async function openBoard() {
    board = board || await load("board");
    return board;
  }

  /** All samples; read when the first is looked at. */
  async function openSamples() {
    await openBoard();
    if (!index) {
      index = await load("samples");
      Solid.setKit(index.kit.shapes, index.kit.colors);
      index.rowsOfItem = grouped(index.rows.item, index.items.key.length);
      index.rowsOfEntry = grouped(index.rows.entry, board.rows.length);
    }
    return index;
  }

  function grouped(column, count) {
    const found = Array.from({ length: count }, () => []);
    column.forEach((value, row) => found[value].push(row));
    return found;
  }

  /** Number `n` of what stands in chunks of one kind: replays, scenes or questions. */
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

  /** What the index knows of a sample. */
  function sample(row) {
    const { rows, items } = index;
    const item = rows.item[row];
    const score = rows.score[row];
    return {
      row, item, key: items.key[item], track: board.tracks.find(({ name }) => name === index.tracks[items.track[item]]),
      scene: index.scenes[items.scene[item]], sceneNumber: items.scene[item], levels: items.levels[item],
      part: items.part[item], question: items.question[item], entry: board.rows[rows.entry[row]],
      seed: rows.seed[row], way: index.ways[rows.way[row]], outcome: index.outcomes[rows.outcome[row]],
      score: score === null ? null : score / 10,
    };
  }

  return {
    openBoard, openSamples, entry, sample,
    get board() {
      return board;
    },
    get index() {
      return index;
    },
  };
})();
