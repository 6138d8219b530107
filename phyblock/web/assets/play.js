/* A session from the first page to the last: its state is shown, one question at a time. The server is
   asked for what is next, and told what was answered. */
"use strict";

(() => {
  const main = document.getElementById("main");
  const progress = document.getElementById("progress");
  const clock = document.getElementById("clock");
  const pause = document.getElementById("pause");
  const RETRY_MS = 1500;
  const shown = { change: -1, phase: "", keys: null, since: null, number: 0, notice: "" };
  const { number } = Words;

  async function checked(answer) {
    if (!answer.ok) throw new Error(String(answer.status));
    return answer.json();
  }
  const next = async (change) => checked(await fetch(change < 0 ? "state" : `state?after=${change}`));
  const send = async (name, body = {}) => checked(await fetch(name, {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) }));
  const post = (name) => send(name).catch(() => {});

  const tick = () => {
    const whole = Math.floor((performance.now() - shown.since) / 1000);
    clock.textContent = shown.since === null ? "" : `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
  };
  const card = (...children) => main.replaceChildren(el("section", { class: "card" }, children));
  const button = (text, act) => el("button", { type: "button", onclick: act }, text);

  const views = {
    start({ about }) {
      progress.textContent = "";
      const left = about.of - about.done;
      card(
        el("h1", {}, "Can you build this?"),
        el("p", { class: "lead" }, about.done
          ? `Welcome back. ${Words.count(left, "task")} of ${about.of} ${left === 1 ? "is" : "are"} left.`
          : `${Words.count(about.of, "task")} for ${about.name}.`),
        el("ul", {}, [
          "You see the pictures that models get. Their exact prompt is one click away; your clicks are turned into the written answer that it asks for.",
          "Click a numbered block or an option to pick it. If the task also asks for places, type the numbers. You can undo everything until you submit; then your answer is kept, and the next task follows.",
          "Without a mouse: type the number or letter (then Enter if it could be the start of a longer one), Backspace undoes, Ctrl+Enter submits.",
          "Your answers and the time that each takes are written to a file on this computer; nothing goes over the network. Pause stops the clock and hides the task. Scores are shown at the end.",
        ].map((text) => el("li", {}, text))),
        button("Begin", () => post("begin")),
      );
    },
    warmed({ went }) {
      progress.textContent = "Warm-up";
      card(el("h1", {}, "That was the warm-up"), given(went),
        el("p", {}, "It does not count. From now on answers are kept; you see the results at the end."), button("Begin", () => post("begin")));
    },
    waiting() {
      card(el("p", { class: "lead", role: "status" }, "One moment …"));
    },
    question({ question, change, elapsed_s: elapsed, exact }) {
      progress.textContent = question.number ? `Task ${question.number} of ${question.of}` : "Warm-up: it does not count";
      shown.since = performance.now() - 1000 * elapsed;
      shown.keys = Picker.show(main, question, (answer) => submit(change, answer), exact);
      if (shown.notice) main.prepend(el("p", { class: "notice", role: "alert" }, shown.notice));
      if (shown.number !== question.number) scrollTo(0, 0);
      shown.number = question.number;
    },
    paused() {
      card(el("h1", {}, "Paused"),
        el("p", {}, "The clock is stopped. Everything you submitted is kept; you may also close this page and continue another day."),
        button("Continue", () => post("begin")));
    },
    closed() {
      card(el("h1", {}, "The session was closed"), el("p", {}, "Everything you submitted is kept."));
    },
    lost() {
      card(el("h1", {}, "The program behind this page has stopped"),
        el("p", {}, "Everything you submitted is kept. Start it again with the same command, and open the address that it prints."));
    },
    done({ results }) {
      progress.textContent = "Done";
      main.replaceChildren(el("div", { class: "results" }, el("h1", {}, "How it went"),
        results.notes.map((note) => el("p", { class: "notice" }, note)),
        results.tracks.map(ofTrack),
        el("div", { class: "tools" },
          el("a", { href: "card.png", download: "phyblock.png" }, "Save a picture of the result"),
          el("a", { href: "report.html", target: "_blank" }, "The whole report, with replays (in a new tab)"),
          button("Finish", (event) => {
            event.target.disabled = true;
            event.target.textContent = "You can close this page";
            post("finish");
          }))));
    },
  };

  // ---- the end

  /** The person between a rule and the best model, all means, and every item. */
  function ofTrack(track) {
    return el("section", {}, el("h2", {}, track.title),
      el("p", { class: "finding" }, track.line.map(([name, value]) => `${name} ${number(value)}`).join(" · ")),
      el("p", { class: "muted" }, `${track.measure}, mean over ${Words.count(track.rows.length, track.item)}${track.unit && ` [${track.unit}]`}`),
      track.means.length < 2 ? null : el("details", {}, el("summary", {}, "All means"), scrolled(`${track.title}: means`, el("table", {}, el("tbody", {}, track.means.map(([name, value, n]) =>
        el("tr", { class: name === "You" ? "own" : null }, el("th", { scope: "row", class: "text" }, name), el("td", {}, number(value)), el("td", { class: "muted" }, `n = ${n}`))))))),
      el("ol", { class: "cards" }, track.rows.map((row) => item(row, track))));
  }

  function item(row, track) {
    return el("li", { class: "card" }, el("h3", {}, `${row.key}: ${number(row.value)} ${track.unit}`),
      row.picture && el("figure", {}, el("figcaption", { class: "pair" }, el("span", {}, "Goal"), el("span", {}, "You")),
        el("img", { src: row.picture, loading: "lazy", width: 648, height: 320, alt: "The goal on the left, what you built on the right" })), given(row),
      el("p", { class: "muted" }, row.took_s === null ? null : `You took ${Math.round(row.took_s)} s. `,
        el("a", { href: `report.html#samples?s=${encodeURIComponent(row.sample)}`, target: "_blank", "aria-label": `Replay ${row.key}` }, "Replay")));
  }

  function given({ right, given: answer, correct, steps, missing }) {
    if (right !== undefined) {
      return el("p", {}, correct ? `You answered ${answer}, which is right.` : `You answered ${answer || "nothing"}; ${right} is right.`);
    }
    if (!steps) return null;
    const first = steps.findIndex((step) => step.why);
    const said = [first >= 0 && `It first broke at step ${first + 1}: ${Words.reason(steps[first].why)}.`,
      missing && `${Words.count(missing, "block")} of the goal ${missing === 1 ? "is" : "are"} missing.`].filter(Boolean);
    return [
      el("ol", { class: "strip", tabindex: 0, "aria-label": "Your steps" }, steps.map((step, n) => el("li", { class: step.why ? "wrong" : "right" },
        `${n + 1} ${step.why ? "✗" : "✓"} `, el("b", { class: "number" }, step.name), step.why ? ` ${Words.reason(step.why)}` : null))),
      el("p", {}, said.join(" ") || "Every step is right, and nothing is missing."),
    ];
  }

  // ---- the session

  async function submit(change, answer) {
    shown.notice = "";
    try {
      await send("answer", { change, ...answer });
    } catch (error) {
      // 409: the page showed another task than the one that is asked now.
      shown.notice = error.message === "409"
        ? "That answer was not kept: the task was answered in another tab. This is the next one."
        : "That answer could not be kept. Please submit it again.";
      show(await next(-1).catch(() => ({ change: -1, phase: "lost" })));
    }
  }

  function show(state) {
    Object.assign(shown, { change: state.change, phase: state.phase, keys: null, since: null });
    pause.hidden = state.phase !== "question";
    views[state.phase](state);
    tick();
    main.focus({ preventScroll: true });
  }

  async function follow() {
    for (;;) {
      try {
        const state = await next(shown.change);
        if (state.change === shown.change) continue;
        show(state);
        if (["closed", "done"].includes(state.phase)) return;
      } catch {
        if (shown.phase !== "lost") show({ change: -1, phase: "lost" });
        await new Promise((go) => setTimeout(go, RETRY_MS));
      }
    }
  }

  pause.addEventListener("click", () => post("pause"));
  document.addEventListener("keydown", (event) => shown.keys?.(event));
  setInterval(tick, 500);
  follow();
})();
