/* A goal and a build side by side, step by step: drawings that turn together, and a timeline. */
"use strict";

const Stage = (() => {
  const PLAY_MS = 900;
  const DROP_MS = 250;
  const FALL_MS = 600;
  const DROP_M = 0.05;
  const BADGES_FROM_PX = 500;
  const HOME = [45, 22];
  const DEGREES_PER_PX = 0.5;
  const DEGREES_PER_KEY = 10;

  // Registered, so that they are read as they are in the theme of the page.
  for (const name of ["--accent", "--tried", "--grid"]) CSS.registerProperty({ name, syntax: "<color>", inherits: true, initialValue: "#3a4cc4" });
  const rgb = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).match(/\d+/g).map(Number);
  const isStill = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

  /** One clock and one camera for all drawings of a sample: position 0 is nothing, `last` the end. */
  class Player {
    constructor(last, wrong = []) {
      this.last = last;
      this.wrong = wrong;
      this.at = wrong.length ? wrong[0] : last;
      this.view = [...HOME];
      this.timer = null;
      this.listeners = [];
    }

    seek(at) {
      this.at = Math.max(0, Math.min(this.last, at));
      this.tell();
    }

    /** Go to a step because somebody wants to see it. */
    stopAt(at) {
      clearInterval(this.timer);
      this.timer = null;
      this.seek(at);
    }

    look(azimuth, elevation) {
      this.view = [azimuth, Math.max(2, Math.min(89, elevation))];
      this.tell();
    }

    tell() {
      this.listeners.forEach((listener) => listener(this));
    }

    get isHome() {
      return this.view.every((angle, i) => angle === HOME[i]);
    }

    toggle() {
      if (this.timer) return this.stopAt(this.at);
      if (this.at >= this.last) this.at = 0;
      this.timer = setInterval(() => (this.at >= this.last ? this.stopAt(this.at) : this.seek(this.at + 1)), PLAY_MS);
      return this.tell();
    }
  }

  /** Steps of some runs that went wrong, each once, the first one first. */
  const wrongSteps = (runs) => [...new Set(runs.flatMap(({ steps }) =>
    steps.flatMap((step, i) => (step.why ? [i + 1] : []))))].sort((a, b) => a - b);

  /** Buttons and timeline of a player; a tick stands under each step that went wrong. */
  function controls(player, noun) {
    const button = (text, name, act, more = {}) => el("button", { type: "button", class: "quiet", "aria-label": name, title: name, onclick: act, ...more }, text);
    const play = button("Play", null, () => player.toggle(), { class: "play", id: "play" });
    const slider = el("input", {
      type: "range", min: 0, max: player.last, step: 1, id: "scrub", "aria-label": noun,
      // All listeners are told, who put the slider to where the player is.
      oninput: () => player.stopAt(Number(slider.value)),
    });
    const ticks = el("div", { class: "ticks", "aria-hidden": "true" }, player.wrong.map((at) =>
      el("i", { class: "wrong-step", style: { left: `${(100 * at) / player.last}%` } })));
    const where = el("output", { class: "number" });
    const home = button("Reset view", "Turn back to the first view", () => player.look(...HOME));
    player.listeners.push(() => {
      play.textContent = player.timer ? "Pause" : "Play";
      slider.value = player.at;
      where.textContent = player.at === player.last ? "End" : `${noun} ${player.at} of ${player.last - 1}`;
      home.hidden = player.isHome;
    });
    return el("div", { class: "controls" }, button("‹", "One step back", () => player.stopAt(player.at - 1)), play,
      button("›", "One step on", () => player.stopAt(player.at + 1)), el("div", { class: "timeline" }, slider, ticks), where, home);
  }

  /** The parts of one run's panel: drawings with titles, what the step did, all steps as buttons. */
  function panel(run, player, noun, scene, quotes) {
    const pictures = (run.framed ? run.titles : []).map((title) => ({
      title, at: null, moving: 0, canvas: el("canvas", { class: "stage", role: "img", tabindex: 0 }) }));
    const said = el("div", { class: "said", "aria-live": "polite" });
    const strip = el("ol", { class: "strip" }, run.steps.map((step, i) => el("li", {}, el("button", {
      type: "button", class: step.why ? "wrong" : "right", "data-step": i + 1, onclick: () => player.stopAt(i + 1),
      title: `${noun} ${i + 1}: candidate ${step.number}${step.name && `, ${step.name}`}, ${step.verdict}`,
    }, `${i + 1} ${step.why ? "✗" : "✓"} `, el("b", {}, step.number ?? Words.DASH),
    el("span", { class: "muted" }, ` ${step.why ? step.label : step.name}`)))));
    const end = run.steps.length + 1;
    pictures.forEach(({ canvas }) => turnable(canvas, player));
    player.listeners.push(() => {
      const at = player.at >= player.last ? end : Math.min(player.at, end);
      strip.querySelectorAll("button").forEach((button, i) => button.setAttribute("aria-current", String(i + 1 === at)));
      said.replaceChildren(...sayings(run, at, noun, quotes));
      pictures.forEach((picture, i) => show(picture, run, i, at, player, scene));
    });
    return { pictures, said, strip };
  }

  /** What became of a step, why, and the sentence of the reply behind it. */
  function sayings(run, at, noun, quotes) {
    const line = (text, kind = null) => (text ? el("p", { class: kind }, text) : "");
    if (at === 0) return [line("Nothing is placed yet.", "muted")];
    const step = run.steps[at - 1];
    if (!step) return [el("p", {}, el("strong", {}, "End"), ` ${run.end}`), line(run.ghosts, "muted")];
    const candidate = step.name ? `${step.number} (${step.name})` : step.number;
    return [
      el("p", {}, el("strong", {}, `${noun} ${at}`), candidate === null ? " " : ` Candidate ${candidate} `,
        el("span", { class: `verdict ${step.why ? "wrong" : "right"}` }, `${step.why ? "✗" : "✓"} ${step.verdict}`)),
      line(step.text), line(step.note, "muted"), line(step.where, "muted"),
      quotes[at - 1] ? el("blockquote", { class: "quote" }, quotes[at - 1]) : "",
    ];
  }

  /** Draw where the player stands; a step forward moves from the state before it. */
  function show(picture, run, place, at, player, scene) {
    const state = run.states[at]?.[place], { canvas, title } = picture;
    if (!state || !canvas.isConnected || !canvas.clientWidth) return;
    canvas.setAttribute("aria-label", `${title}: ${Words.count(state.blocks.length, "block")}. Drag or use the arrow keys to turn it.`);
    const before = picture.at !== null && at === picture.at + 1 ? run.states[picture.at][place] : null;
    const isTurned = picture.at === at;
    picture.at = at;
    if (isTurned && picture.moving) return;
    cancelAnimationFrame(picture.moving);
    picture.moving = 0;
    const draw = (blocks, isDone) => {
      const step = isDone ? run.steps[at - 1] : null;
      const numbers = scene ? blocks.map((block) => Steps.badge(scene, block)) : [];
      Solid.draw(canvas, blocks, {
        ...looks(), ...state, view: player.view, framed: run.framed, tried: step?.tried, triedBadge: String(step?.number),
        badges: canvas.clientWidth >= BADGES_FROM_PX ? numbers : numbers.map((one, i) => (blocks[i] === state.fresh ? one : "")),
      });
    };
    if (!before || !Solid.ready || isStill()) draw(state.blocks, true);
    else move(picture, before.blocks, state, draw);
  }

  const looks = () => ({ accent: rgb("--accent"), triedColor: rgb("--tried"), grid: rgb("--grid") });

  function move(picture, before, state, draw) {
    const began = performance.now();
    const isNew = (block) => block === state.fresh && !before.includes(block);
    const moves = Solid.between(before, state.blocks, 0).some((block, i) => block !== state.blocks[i]);
    const whole = DROP_MS + (moves ? FALL_MS : 0);
    const tick = () => {
      const past = performance.now() - began;
      if (past >= whole || !picture.canvas.isConnected) {
        picture.moving = 0;
        draw(state.blocks, true);
        return;
      }
      const dropped = Math.min(1, past / DROP_MS), fallen = Math.max(0, past - DROP_MS) / FALL_MS;
      const lift = DROP_M * (1 - dropped) ** 2;
      draw(Solid.between(before, state.blocks, fallen ** 2).map((block, i) => {
        const [x, y, z] = block.position;
        return isNew(state.blocks[i]) ? { ...block, position: [x, y, z + lift] } : block;
      }), false);
      picture.moving = requestAnimationFrame(tick);
    };
    tick();
  }

  /** Drag, touch or the arrow keys turn all drawings of a player; a double click turns back. */
  function turnable(canvas, player) {
    let from = null;
    canvas.classList.add("turnable");
    canvas.addEventListener("pointerdown", (event) => {
      from = [event.clientX, event.clientY, ...player.view];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      const [x, y, azimuth, elevation] = from;
      player.look(azimuth - (event.clientX - x) * DEGREES_PER_PX, elevation + (event.clientY - y) * DEGREES_PER_PX);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, () => {
        from = null;
      });
    }
    canvas.addEventListener("dblclick", () => player.look(...HOME));
    canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!by && event.key !== "Home") return;
      event.preventDefault();
      event.stopPropagation();
      if (by) player.look(...player.view.map((angle, i) => angle + DEGREES_PER_KEY * by[i]));
      else player.look(...HOME);
    });
  }

  // ---- single pictures

  /**
   * A canvas that is drawn when it comes into sight. `drawing` is [blocks, options], or a function
   * that promises it, and null where there is nothing. With a player it turns with the others.
   */
  function picture(label, drawing, player = null) {
    const canvas = el("canvas", { class: "picture", role: "img", "aria-label": label });
    canvas.drawing = drawing;
    if (player) {
      turnable(canvas, player);
      player.listeners.push(() => {
        canvas.view = player.view;
        if (canvas.clientWidth) drawn(canvas);
      });
    } else inSight.observe(canvas);
    return canvas;
  }

  /** A candidate alone. */
  const candidate = (one, n) => picture(`Candidate ${n}: ${Words.block(one)}`,
    [[Solid.onTheFloor(one)], { minDistance: 0, grid: null }]);

  async function drawn(canvas) {
    if (typeof canvas.drawing === "function") canvas.drawing = await canvas.drawing();
    if (!canvas.drawing || !canvas.isConnected) return;
    const [blocks, options = {}] = canvas.drawing;
    const badges = canvas.clientWidth >= BADGES_FROM_PX ? options.badges : [];
    Solid.draw(canvas, blocks, { ...looks(), view: canvas.view || HOME, ...options, badges });
  }

  const inSight = new IntersectionObserver((seen) => {
    for (const { target, isIntersecting } of seen) if (isIntersecting) drawn(target);
  }, { rootMargin: "300px" });

  /** Draw all pictures that were drawn again, after a change of size or colors; all that go on paper. */
  function redraw(place, isPrinted = false) {
    for (const canvas of place.querySelectorAll("canvas.picture")) {
      if (isPrinted || canvas.dataset.drawn) drawn(canvas);
    }
  }

  return { Player, wrongSteps, controls, panel, picture, candidate, draw: drawn, redraw, isStill };
})();
