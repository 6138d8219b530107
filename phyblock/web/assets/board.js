/* The first page of a site: the finding, the ranking as bars, what it looks like, and how to take part. */
"use strict";

const Board = (() => {
  const LOOP_MS = 900;
  const REST_MS = 2600;
  const isModel = (row) => row.kind !== "baseline";
  const to = {
    model: (row) => Site.address("model", { m: row.name }),
    error: (row) => Site.address("model", { m: row.name }),
  };
  let clock = null;

  async function view(words) {
    const data = await Store.openBoard();
    const track = data.tracks.find(({ name }) => name === words.get("by")) || data.tracks[0];
    const main = data.columns.find((column) => column.track === track.name && column.heading === track.main);
    const hero = el("div", { class: "hero-build", "aria-hidden": "true" });
    const failures = el("ul", { class: "failures" });
    return [
      el("section", { class: "hero" },
        el("div", { class: "hero-text" },
          el("h1", {}, data.title),
          el("p", { class: "lead" }, document.querySelector("meta[name=description]").content.split(". ")[0] + "."),
          el("p", { class: "finding" }, track.finding),
          el("p", { class: "muted" }, "Try it yourself: ", el("code", {}, "phyblock play quick"), " gives you the models' own tasks in a browser.")),
        hero),
      el("section", { "aria-labelledby": "ranking" }, el("h2", { id: "ranking" }, "Ranking"), choice(data, track, words), Ranking.bars(data, track, main, to)),
      Ranking.slope(data, track, main, to),
      Ranking.losses(data, track, main, to),
      el("section", { id: "failures", hidden: true, "aria-labelledby": "failures-title" },
        el("h2", { id: "failures-title" }, "How they fail"), failures),
      more(data, track, main, words),
      method(data, track),
      filled(hero, failures),
    ].filter((part) => part instanceof Node);
  }

  function choice(data, track, words) {
    if (data.tracks.length < 2) return null;
    return el("label", { class: "choice" }, el("span", {}, "Ranked by"),
      el("select", { id: "by", onchange: (event) => Site.go("board", { by: event.target.value === data.tracks[0].name ? "" : event.target.value, more: words.get("more") }) },
        data.tracks.map((one) => el("option", { value: one.name, selected: one === track }, `${one.title}: ${one.main}`))));
  }

  // ---- what it looks like

  /** Once the page stands, bring what its pictures need; where it cannot be drawn, they stay away. */
  function filled(hero, failures) {
    setTimeout(async () => {
      const index = await Store.openSamples();
      const known = index.starts.scenes.length ? index.telling : [];
      const cards = await Promise.all(known.map(async ({ row }) => {
        const sample = Store.sample(row);
        return Ranking.failure({ scene: await Store.entry("scenes", sample.sceneNumber), record: await Store.entry("replays", row),
          name: sample.entry.name, href: Site.address("replay", Site.wordsOf(sample)) });
      }));
      const drawn = cards.filter(Boolean);
      if (!drawn.length || !failures.isConnected) return hero.remove();
      failures.append(...drawn.map(({ item }) => item));
      failures.closest("section").hidden = false;
      for (const one of drawn) one.draw();
      return loop(hero, drawn[0]);
    });
  }

  /** The goal, its candidates and the build, which begins again after its end. */
  function loop(hero, { scene, run, name }) {
    const goal = Stage.picture("The goal", scene.blocks, { grid: true });
    const built = Stage.picture("What was built", [], { framed: scene.blocks, grid: true });
    const said = el("p", { class: "muted" });
    hero.append(
      el("figure", {}, el("figcaption", {}, "Goal"), goal),
      el("ol", { class: "hero-candidates" }, scene.candidates.map((candidate, i) => el("li", {},
        el("span", { class: "number" }, String(i + 1)), Stage.picture(`Candidate ${i + 1}`, [Solid.onTheFloor(candidate)], { minDistance: 0 }, "cell")))),
      el("figure", {}, el("figcaption", {}, `Built by ${name}`), built, said));
    Stage.draw(hero);
    const end = run.steps.length;
    let at = matchMedia("(prefers-reduced-motion: reduce)").matches ? end : 0;
    const tick = () => {
      if (!hero.isConnected) return;
      const state = run.states[at][0], step = run.steps[at - 1];
      const tried = step?.why ? Overlay.block(scene, step) : null;
      built.drawing = [state.blocks, { ...state, ghosts: [], framed: scene.blocks, grid: true, tried, triedBadge: tried ? String(step.number) : "" }];
      said.textContent = step ? `Step ${at}: candidate ${step.number}${step.why ? ` ✗ ${step.verdict}` : " ✓"}` : "";
      Stage.draw(built.parentElement);
      if (matchMedia("(prefers-reduced-motion: reduce)").matches) return;
      clock = setTimeout(tick, at === end ? REST_MS : LOOP_MS);
      at = at === end ? 0 : at + 1;
    };
    clearTimeout(clock);
    tick();
  }

  // ---- all numbers

  function more(data, track, main, words) {
    const part = el("details", { class: "more", id: "more", open: words.get("more") ? true : null },
      el("summary", {}, "All numbers: intervals, settings, tokens and cost"), Ranking.numbers(data, track, main, to), chart(data, track, main, words));
    part.addEventListener("toggle", () => {
      const now = Site.address("board", { ...Object.fromEntries(words), more: part.open ? "1" : "" });
      history.replaceState(null, "", now);
    });
    return part;
  }

  function chart(data, track, main, words) {
    const axes = main ? Chart.axes(data, track) : [];
    if (!axes.length) return null;
    const axis = axes.some(([name]) => name === words.get("x")) ? words.get("x") : axes[0][0];
    const { drawing, without } = Chart.draw(data, track, main, axis);
    return el("section", { class: "costs" }, el("h3", {}, "Cost against score"),
      el("label", { class: "choice" }, el("span", {}, "Across"), el("select", { id: "axis", onchange: (event) => Site.go("board", { ...Object.fromEntries(words), more: "1", x: event.target.value }) },
        axes.map(([name, title]) => el("option", { value: name, selected: name === axis }, title)))),
      el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Cost against score" }, drawing),
      without.length ? el("p", { class: "notes" }, `Not drawn, as nothing is known: ${without.map((row) => row.name).join(", ")}.`) : null);
  }

  // ---- how it was done

  function method(data, track) {
    const { runs } = data;
    const samples = data.rows.flatMap((row) => Object.values(row.facts)).reduce((sum, fact) => sum + fact.done, 0);
    const dates = runs.map((run) => run.date).filter(Boolean).sort();
    const verified = runs.filter((run) => run.verified).length;
    return el("section", { class: "method", "aria-labelledby": "method" }, el("h2", { id: "method" }, "Method"),
      el("ul", { class: "notes" },
        el("li", {}, `${Words.count(data.rows.filter(isModel).length, "model")}, ${Words.count(samples, "sample")}${runs[0].data ? ` on ${runs[0].data}, version ${runs[0].version}` : ""}${dates.length ? `, ${dates[0] === dates.at(-1) ? dates[0] : `${dates[0]} to ${dates.at(-1)}`}` : ""}. ${verified ? `${verified} of ${Words.count(runs.length, "run")} independently re-scored.` : ""}`),
        track.notes.map((note) => el("li", {}, note)),
        el("li", {}, "Thin bars are 95 % intervals: jackknife over base scenes. Ranks are ranges: paired tests of every pair of models, corrected for their number (Holm). Baselines have no rank, nor have models that are not complete."),
        track.physics ? el("li", {}, `${track.title}: what fell is taken from the records; physics is not run again.`) : null),
      el("h3", {}, "Take part"),
      el("p", {}, "Run the suite, then send the bundle; it is scored again before it is listed:"),
      el("pre", { tabindex: 0 }, el("code", {}, `phyblock run ${runs[0].suite || "full"} --models my-model\nphyblock bundle results/${runs[0].suite || "full"}-… --out my-model.zip`)),
      el("h3", {}, "Cite"),
      el("p", { class: "notes" }, "Ma, Wen, Lin, Xu, Liang, Lin et al.: PhyBlock: A Progressive Benchmark for Physical Understanding and Planning via 3D Block Assembly. NeurIPS 2025, Datasets and Benchmarks Track."));
  }

  return { view };
})();
