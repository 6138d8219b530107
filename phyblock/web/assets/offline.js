/* The session of a folder without a server: questions lie beside the page, answers in the browser until
   they are saved as a file. */
"use strict";

const Session = (() => {
  const loaded = new Promise((done, failed) => {
    const script = document.createElement("script");
    script.src = "questions.js";
    script.onload = () => done(SESSION);
    script.onerror = failed;
    document.head.append(script);
  });
  const state = { change: 0, phase: "consent", since: null, before: 0, agreed: "", answers: [] };
  let wake = () => {};

  const key = (session) => `phyblock ${session.head.run} ${session.head.model}`;
  const ready = loaded.then((session) => {
    takeUp(session, { isNew: true });
    setInterval(() => keep(session), 500);
    if (state.answers.length === session.questions.length) state.phase = "saved";
    return session;
  });

  const stored = (session) => JSON.parse(localStorage.getItem(key(session)) || "null");

  /** Take up what another tab has stored since, or what was stored before the page was opened;
      whether there was any. */
  function takeUp(session, { isNew } = {}) {
    const kept = stored(session);
    if (!kept || (!isNew && kept.answers.length <= state.answers.length)) return false;
    Object.assign(state, { agreed: kept.agreed, answers: kept.answers, since: null, before: kept.before || 0 });
    return true;
  }

  const elapsed = () => state.before + (state.since === null ? 0 : (performance.now() - state.since) / 1000);

  /** Store answers and how long the next has taken, so that a reload sets no clock back; unless
      another tab is further. */
  function keep(session) {
    if (!state.agreed || (stored(session)?.answers.length ?? 0) > state.answers.length) return;
    const { agreed, answers } = state;
    localStorage.setItem(key(session), JSON.stringify({ agreed, answers, before: elapsed() }));
  }

  function goTo(phase) {
    state.phase = phase;
    state.change += 1;
    wake();
  }

  async function next(change) {
    const session = await ready;
    while (change === state.change) await new Promise((go) => { wake = go; });
    const told = { change: state.change, phase: state.phase };
    if (state.phase === "consent") {
      told.about = { name: session.name, consent: session.text, done: state.answers.length, of: session.questions.length };
    } else if (state.phase === "question") {
      if (state.since === null) state.since = performance.now();
      told.question = session.questions[state.answers.length];
      told.elapsed_s = elapsed();
    } else if (state.phase === "saved") {
      told.session = { save: () => save(session) };
    }
    return told;
  }

  async function post(name, body) {
    const session = await ready;
    const question = () => goTo(state.answers.length === session.questions.length ? "saved" : "question");
    const isBehind = takeUp(session);
    if (name === "agree") {
      state.agreed = state.agreed || new Date().toISOString();
      question();
    } else if (name === "pause") {
      state.before = elapsed();
      state.since = null;
      goTo("paused");
    } else if (name === "resume") {
      question();
    } else if (name === "answer") {
      if (isBehind || body.change !== state.change) {
        question();
        throw new Error("409");
      }
      const { picks, numbers } = body;
      const answer = { number: state.answers.length + 1, picks, numbers, took_s: Math.round(1000 * elapsed()) / 1000 };
      const answers = [...state.answers, answer];
      localStorage.setItem(key(session), JSON.stringify({ agreed: state.agreed, answers, before: 0 }));
      Object.assign(state, { answers, since: null, before: 0 });
      question();
    }
  }

  function save(session) {
    const content = { ...session.head, agreed: state.agreed, answers: state.answers };
    const address = URL.createObjectURL(new Blob([JSON.stringify(content, null, 1)], { type: "application/json" }));
    const name = `answers-${session.name}.json`;
    el("a", { href: address, download: name }).click();
  }

  return { next, post };
})();
