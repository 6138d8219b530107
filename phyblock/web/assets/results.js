/* The results of a run: what was found in sentences, rankings, errors, failures, and all tables. */
"use strict";

const Results = (() => {
  const { text } = Table;
  const address = (words) => Address.text("samples", words);

  /** Show the results of every track; what is drawn of samples comes when the data are there. */
  function start() {
    const data = JSON.parse(document.getElementById("board").textContent);
    const several = data.tracks.length > 1;
    for (const track of data.tracks) {
      const main = data.columns.find((column) => column.track === track.name && column.heading === track.main);
      const words = several ? { track: track.name } : {};
      const to = {
        model: (row) => address({ ...words, model: row.name }),
        error: (row, name) => address({ ...words, model: row.name, error: name }),
        part: (row, cell) => address({ ...words, model: row.name, ...partOf(data, cell) }),
      };
      document.getElementById(`ranking-${track.name}`).replaceChildren(...[
        el("ul", { class: "sentences" }, sentences(data, track, main).map((sentence, i) => el("li", { class: i === 0 ? "finding" : "" }, sentence))),
        Ranking.bars(data, track, main, to),
        el("details", { class: "more" }, el("summary", {}, "All numbers: intervals, settings, tokens and cost"), Ranking.numbers(data, track, main, to)),
        el("ul", { class: "notes" }, [...track.notes, "Thin bars are 95 % intervals: jackknife over base scenes. Ranks are ranges: paired tests of every pair of models, corrected for their number (Holm)."].map((note) => el("li", {}, note))),
        Ranking.slope(data, track, main, to), Ranking.losses(data, track, main, to),
      ].filter(Boolean));
    }
  }

  /** The filter that a cell of the tables stands for: a level, a subtask or a group of them. */
  const partOf = (data, cell) => (/^\d$/.test(cell) ? { level: cell } : data.parts.includes(cell) ? { subtask: cell } : {});

  /** Which model is best, how the models stand to a rule that never sees the goal, which error is most frequent. */
  function sentences(data, track, main) {
    const models = data.rows.filter((row) => row.kind !== "baseline" && main && row.values[main.id]);
    const [best] = Table.sorted(models, { value: (row) => row.values[main.id][0] }, track.better !== "lower");
    const wrong = new Map();
    for (const row of models) for (const [name, share] of Object.entries(row.facts[track.name]?.errors || {})) wrong.set(name, (wrong.get(name) || 0) + share / models.length);
    const [error] = [...wrong].sort((a, b) => b[1] - a[1]);
    const unit = track.unit === "%" ? " %" : track.unit ? ` ${track.unit}` : "";
    const interval = best && best.values[main.id][1] !== null ? ` (${text(best.values[main.id][1])} to ${text(best.values[main.id][2])})` : "";
    return [
      track.finding,
      best ? `Best: ${best.name}, ${track.main} ${text(best.values[main.id][0])}${unit}${interval}${best.ranks[track.name] && best.ranks[track.name][1] > 1 ? `; others may be as good: rank ${Table.rank(best, track.name)}` : ""}.` : "",
      error ? `Most frequent error: ${Words.named(error[0])}, ${text(error[1], 0)} % of wrong steps in the mean of models.` : "",
    ].filter(Boolean);
  }

  /** Draw the failures that tell most, once the data of samples are there. */
  async function fill() {
    const part = document.getElementById("failures");
    if (!Data.index.starts.scenes.length || part.childElementCount) return;
    const cards = await Promise.all(Data.index.telling.map(async ({ row }) => {
      const sample = Data.sample(row);
      return Ranking.failure({ scene: await Data.entry("scenes", sample.sceneNumber), record: await Data.entry("records", row),
        name: sample.asked, href: address({ s: sample.id }) });
    }));
    const drawn = cards.filter(Boolean);
    part.append(...drawn.map(({ item }) => item));
    part.closest("section").hidden = !drawn.length;
    for (const one of drawn) one.draw();
  }

  return { start, fill };
})();
