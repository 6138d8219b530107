/* The assembly step by step: a drawing that can be turned, a filmstrip, play and scrub. */
"use strict";

const Stage = (() => {
  const PLAY_MS = 850;
  const THUMB_PX = 76;
  const HOME = [45, 22];
  const DEGREES_PER_PX = 0.5;

  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const accent = () => style("--accent-rgb").split(",").map(Number);

  /** One clock for all panels of a sample: position 0 is nothing, `last` the end. */
  class Player {
    constructor(last) {
      this.last = last;
      this.at = last;
      this.view = [...HOME];
      this.timer = null;
      this.listeners = [];
    }

    seek(at) {
      this.at = Math.max(0, Math.min(this.last, at));
      this.tell();
    }

    tell() {
      this.listeners.forEach((listener) => listener(this));
    }

    get isPlaying() {
      return this.timer !== null;
    }

    toggle() {
      if (this.isPlaying) return this.stop();
      if (this.at >= this.last) this.at = 0;
      this.timer = setInterval(() => {
        if (this.at >= this.last) this.stop();
        else this.seek(this.at + 1);
      }, PLAY_MS);
      return this.tell();
    }

    stop() {
      clearInterval(this.timer);
      this.timer = null;
      this.tell();
    }
  }

  /** Buttons and slider of a player. */
  function controls(player, noun) {
    const play = el("button", { type: "button", class: "play", id: "play", onclick: () => player.toggle() });
    const slider = el("input", {
      type: "range", min: 0, max: player.last, step: 1, id: "scrub", "aria-label": "Step",
      oninput: () => {
        // Stopping tells all listeners, who put the slider back to where the player is.
        const at = Number(slider.value);
        player.stop();
        player.seek(at);
      },
    });
    const where = el("output", { class: "number" });
    const step = (by, text, name) => el("button", {
      type: "button", class: "quiet", "aria-label": name,
      onclick: () => {
        player.stop();
        player.seek(player.at + by);
      },
    }, text);
    player.listeners.push(() => {
      play.textContent = player.isPlaying ? "Pause" : "Play";
      slider.value = player.at;
      const steps = player.last - 1;
      where.textContent = player.at > steps ? "End" : `${noun} ${player.at} of ${steps}`;
    });
    return el("div", { class: "controls" }, step(-1, "‹", "One step back"), play,
      step(1, "›", "One step on"), slider, where);
  }

  /** The parts of one sample's panel: drawing, what the step did, filmstrip. */
  function panel(scene, steps, player, noun = "Step") {
    const canvas = el("canvas", { class: "stage", role: "img" });
    const said = el("div", { class: "said", "aria-live": "polite" });
    const strip = el("ol", { class: "strip" });
    const end = steps.length + 1;
    const local = () => (player.at >= player.last ? end : Math.min(player.at, end));
    steps.forEach((step, i) => strip.append(frame(scene, step, i, player, noun)));
    if (scene) turnable(canvas, player);
    player.listeners.push(() => {
      const at = local();
      strip.querySelectorAll("button").forEach((button, i) =>
        button.setAttribute("aria-current", String(i + 1 === at)));
      follow(strip, at);
      say(said, scene, steps, at, noun);
      if (scene) paint(canvas, scene, steps, at, player.view);
    });
    if (scene) lazily(strip, scene, steps);
    return { canvas, said, strip };
  }

  function frame(scene, step, i, player, noun) {
    const mark = step.why ? "✗" : "✓";
    const what = step.why ? Words.named(step.why) : "Correct";
    const name = scene && scene.candidates[step.number - 1] ? `, ${Words.block(scene.candidates[step.number - 1])}` : "";
    return el("li", {}, el("button", {
      type: "button", class: step.why ? "wrong" : "right", "data-step": i + 1,
      "aria-label": `${noun} ${i + 1}: candidate ${step.number}${name}, ${what}`,
      onclick: () => {
        player.stop();
        player.seek(i + 1);
      },
    },
    scene ? el("canvas", { class: "thumb", "aria-hidden": "true" }) : null,
    el("span", { class: "strip-head" }, el("span", { class: "number" }, String(i + 1)),
      el("span", { class: "mark" }, mark)),
    el("span", { class: "strip-what" }, step.why ? Words.named(step.why) : `Candidate ${step.number}`)));
  }

  /** Frames are drawn when they come into sight: what stood after the step, or the wrong block. */
  function lazily(strip, scene, steps) {
    const watch = new IntersectionObserver((seen) => {
      for (const { target, isIntersecting } of seen) {
        if (!isIntersecting) continue;
        watch.unobserve(target);
        const step = steps[Number(target.dataset.step) - 1];
        const offered = scene.candidates[step.number - 1];
        const canvas = target.querySelector("canvas");
        if (!step.why) {
          Solid.draw(canvas, blocksOf(scene, step.after), {
            view: HOME, framed: scene.blocks, size: THUMB_PX, accent: accent(),
            fresh: scene.blocks[step.vertex] || null,
          });
        } else if (offered) {
          Solid.draw(canvas, [Solid.onTheFloor(offered)], { view: HOME, size: THUMB_PX, minDistance: 0.4 });
        }
      }
    }, { rootMargin: "200px" });
    strip.querySelectorAll("button").forEach((button) => watch.observe(button));
  }

  const blocksOf = (scene, set) => scene.blocks.filter((_, v) => set.has(v));

  function paint(canvas, scene, steps, at, view) {
    const step = steps[Math.min(at, steps.length) - 1];
    const isEnd = at > steps.length;
    const now = step && at > 0 ? step.after : new Set();
    const rest = isEnd ? scene.blocks.map((_, v) => v).filter((v) => !now.has(v))
      : at > 0 && step ? step.ready : [];
    const fresh = !isEnd && at > 0 && step && step.vertex !== null ? scene.blocks[step.vertex] : null;
    canvas.setAttribute("aria-label", `The structure with ${now.size} of ${scene.blocks.length} blocks placed`);
    Solid.draw(canvas, blocksOf(scene, now), {
      view, framed: scene.blocks, ghosts: rest.map((v) => scene.blocks[v]), fresh,
      accent: accent(), grid: style("--grid"),
    });
  }

  function say(said, scene, steps, at, noun) {
    if (at === 0) {
      said.replaceChildren(el("p", { class: "muted" }, "Nothing is placed yet."));
      return;
    }
    if (at > steps.length) {
      const now = steps.length ? steps[steps.length - 1].after : new Set();
      const wrong = steps.filter((step) => step.why).length;
      const left = scene ? scene.blocks.length - now.size : 0;
      const end = scene ? `${now.size} of ${scene.blocks.length} blocks placed` : `${now.size} blocks placed`;
      const errors = wrong ? `, ${Words.count(wrong, `wrong ${noun.toLowerCase()}`)}` : "";
      said.replaceChildren(el("p", {}, el("strong", {}, "End"), ` ${end}${errors}.`));
      if (left) said.append(el("p", { class: "muted" }, "Outlined: what was not placed."));
      return;
    }
    const step = steps[at - 1];
    const candidate = scene && Number.isInteger(step.number) ? Steps.label(scene, step.number) : step.number;
    const verdict = step.why ? Words.named(step.why) : "Correct";
    const rows = [el("p", {}, el("strong", {}, `${noun} ${at}`),
      step.number === null || step.number === undefined ? " " : ` Candidate ${candidate} `,
      el("span", { class: step.why ? "verdict wrong" : "verdict right" }, `${step.why ? "✗" : "✓"} ${verdict}`))];
    if (step.text) rows.push(el("p", {}, step.text));
    if (step.expected) rows.push(el("p", { class: "muted" }, `Possible here (outlined): ${step.expected}.`));
    said.replaceChildren(...rows);
  }

  function follow(strip, at) {
    const frame = strip.children[at - 1];
    if (!frame) return;
    const left = frame.offsetLeft;
    if (left < strip.scrollLeft || left + frame.offsetWidth > strip.scrollLeft + strip.clientWidth) {
      strip.scrollLeft = left - strip.clientWidth / 2;
    }
  }

  /** Drag to turn; a double click turns back. */
  function turnable(canvas, player) {
    let from = null;
    canvas.addEventListener("pointerdown", (event) => {
      from = [event.clientX, event.clientY, ...player.view];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      const [x, y, azimuth, elevation] = from;
      const up = elevation + (event.clientY - y) * DEGREES_PER_PX;
      player.view = [azimuth - (event.clientX - x) * DEGREES_PER_PX, Math.max(2, Math.min(89, up))];
      player.tell();
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, () => {
        from = null;
      });
    }
    canvas.addEventListener("dblclick", () => {
      player.view = [...HOME];
      player.tell();
    });
  }

  return { Player, controls, panel, HOME, style, accent };
})();
