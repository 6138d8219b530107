/* A session from the first page to the last: its state is shown, one question at a time. */
"use strict";

(() => {
  const main = document.getElementById("main");
  const progress = document.getElementById("progress");
  const clock = document.getElementById("clock");
  const pause = document.getElementById("pause");
  const RETRY_MS = 1500;
  const shown = { change: -1, phase: "", keys: null, since: null, number: 0, notice: "" };

  const time = (seconds) => {
    const whole = Math.max(0, Math.floor(seconds));
    return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
  };
  const tick = () => {
    clock.textContent = shown.since === null ? "" : time((performance.now() - shown.since) / 1000);
  };
  const post = (name, body = {}) => Session.post(name, body).catch(() => {});
  const card = (...children) => main.replaceChildren(el("section", { class: "card" }, children));
  const primary = (text, act) => el("button", { type: "button", class: "primary", onclick: act }, text);

  const views = {
    consent({ about }) {
      progress.textContent = "";
      const left = about.of - about.done;
      card(
        el("h1", {}, "Can you build this?"),
        el("p", { class: "lead" }, about.done
          ? `Welcome back. ${Words.count(left, "task")} of ${about.of} ${left === 1 ? "is" : "are"} left.`
          : `${Words.count(about.of, "task")} for ${about.name}.`),
        el("div", { class: "consent", tabindex: "0", role: "region", "aria-label": "What you agree to" },
          about.consent.split(/\n{2,}/).map((text) => el("p", {}, text))),
        el("h2", {}, "How it works"),
        el("ul", {},
          el("li", {}, "You see the pictures that models are sent. Their exact prompt is one click away; it asks for a written form, which is written for you from your clicks."),
          el("li", {}, "Click a numbered block or an option to pick it. Where places are asked for as well, type the numbers. All can be undone until you submit; then it is kept, and the next task comes."),
          el("li", {}, "Without a mouse: type the number or letter (Enter where a longer number might follow), Backspace takes back, Ctrl+Enter submits."),
          el("li", {}, "The time you take is written down. Pause stops it and hides the task.")),
        primary("I agree, begin", () => post("agree")),
      );
    },
    waiting() {
      card(el("p", { class: "lead", role: "status" }, "One moment …"));
    },
    question(state) {
      const { question } = state;
      progress.textContent = `Task ${question.number} of ${question.of}`;
      shown.since = performance.now() - 1000 * state.elapsed_s;
      shown.keys = Picker.show(main, question, (answer) => submit(state.change, answer), state.exact);
      if (shown.notice) main.prepend(el("p", { class: "notice", role: "alert" }, shown.notice));
      if (shown.number !== question.number) scrollTo(0, 0);
      shown.number = question.number;
    },
    paused() {
      card(
        el("h1", {}, "Paused"),
        el("p", {}, "The clock stands still. All that you submitted is kept; you may also close this page and go on another day."),
        primary("Go on", () => post("resume")),
      );
    },
    closed() {
      card(el("h1", {}, "The session was closed"), el("p", {}, "All that you submitted is kept."));
    },
    lost() {
      card(
        el("h1", {}, "The program behind this page has stopped"),
        el("p", {}, "All that you submitted is kept. Start it again with the same command, and open the address that it prints."),
      );
    },
    done({ results }) {
      progress.textContent = "Done";
      main.replaceChildren(Results.page(results, () => post("finish")));
    },
  };

  async function submit(change, answer) {
    shown.notice = "";
    try {
      await Session.post("answer", { change, ...answer });
    } catch (error) {
      // 409: what the page showed is not what is asked now.
      shown.notice = error.message === "409"
        ? "That answer was not kept: the task was answered in another tab. This is the next one."
        : "That answer could not be kept. Please submit it again.";
      take(await Session.next(-1).catch(() => ({ change: -1, phase: "lost" })));
    }
  }

  function take(state) {
    shown.change = state.change;
    show(state);
  }

  function show(state) {
    shown.keys = null;
    shown.since = null;
    shown.phase = state.phase;
    pause.hidden = state.phase !== "question";
    main.className = "";
    views[state.phase](state);
    tick();
    main.focus({ preventScroll: true });
  }

  async function follow() {
    for (;;) {
      try {
        const state = await Session.next(shown.change);
        if (state.change === shown.change) continue;
        take(state);
        if (["closed", "done"].includes(state.phase)) return;
      } catch {
        if (shown.phase !== "lost") take({ change: -1, phase: "lost" });
        await new Promise((go) => setTimeout(go, RETRY_MS));
      }
    }
  }

  pause.addEventListener("click", () => post("pause"));
  document.addEventListener("keydown", (event) => shown.keys?.(event));
  setInterval(tick, 500);
  follow();
})();
