/* What a model saw: its prompt and pictures, as they were sent. */
"use strict";

const Sent = (() => {
  /** One sample's prompt, or those of an episode turn by turn; they are loaded as it is made. */
  function panel(sample) {
    const { record } = sample;
    if (!record.turns) return prompt(record.prompt, sample);
    if (!record.turns.some((turn) => turn.prompt)) return prompt(null, sample);
    return el("ol", { class: "turns" }, record.turns.map((turn, i) => el("li", {}, el("details", { open: i === 0 },
      el("summary", {}, `Turn ${turn.n}${turn.step ? `, step ${turn.step}` : ""}`), prompt(turn.prompt, sample)))));
  }

  function prompt(sent, sample) {
    if (!sent) return el("p", { class: "notice" }, nothing(sample));
    const body = el("div", { class: "prompt" });
    fill(body, sent).catch((error) => body.append(el("p", { class: "notice" }, error.message)));
    return body;
  }

  function nothing(sample) {
    const kind = Data.index.model_kinds[sample.model];
    if (kind === "replay") return `Nothing was sent in this run: the reply of ${sample.model} is a recording, and what it was made from is not in it.`;
    if (kind === "baseline") return `Nothing was sent: ${sample.model} is a rule, not a model.`;
    return "Nothing was sent, or nothing of it was kept.";
  }

  async function fill(body, sent) {
    const images = new Map((sent.images || []).map((image) => [image.label, image]));
    if (sent.n === null || sent.n === undefined) {
      body.append(el("p", { class: "muted" }, `Template ${sent.template}; the text was not kept.`));
      for (const image of images.values()) body.append(picture(image));
      return;
    }
    const made = [];
    for (const message of await Data.entry("prompts", sent.n)) {
      made.push(el("p", { class: "role" }, message.role));
      for (const part of message.parts) {
        made.push(typeof part === "string" ? el("pre", { class: "text" }, part)
          : picture(images.get(part.image) || { label: part.image }));
      }
    }
    body.append(...made);
  }

  /** A picture with the bytes that were sent, or word that they are not at hand. */
  function picture(image) {
    const size = image.width_px ? `, ${image.width_px} × ${image.height_px} pixels` : "";
    if (!image.file) {
      return el("p", { class: "notice" }, `Picture “${image.label}”${size}: it was sent, and is not kept beside this page.`);
    }
    return el("figure", {}, el("img", {
      src: image.file, alt: `Picture as sent: ${image.label}`, width: image.width_px, height: image.height_px,
    }), el("figcaption", { class: "muted" }, `${image.label}${size}, as sent`));
  }

  return { panel, picture };
})();
