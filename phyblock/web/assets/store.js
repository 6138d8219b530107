/* The site's data: the ranking, all samples, and what is brought of each when it is looked at. */
"use strict";

const Store = (() => {
  const chunks = chunksOf({ noun: "site", most: 16 });
  let board = null;
  let index = null;

  /** The numbers of the first page. */
  async function openBoard() {
    board = board || await chunks.load("board");
    return board;
  }

  /** All samples; read when the first is looked at. */
  async function openSamples() {
    await openBoard();
    if (!index) {
      index = await chunks.load("samples");
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

  /** Number `n` of the replays, scenes or questions. */
  const entry = (kind, n) => chunks.entry(index.starts[kind], kind, n);

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
