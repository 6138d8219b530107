/* What was picked so far, with every state before, so that any change can be undone; kept while the
   page lives, so that reloading it loses nothing. A pick is {id, place, texts}: which it is wherever
   it is moved, which choice, and what is typed into the number fields that go with it. */
"use strict";

class Picks {
  static MOST_KEPT = 100;

  constructor(key, isPossible) {
    this.key = key;
    this.list = [];
    this.past = [];
    try {
      const kept = JSON.parse(sessionStorage.getItem("picks"));
      if (kept?.key === key && [kept.list, ...kept.past].flat().every(isPossible)) {
        this.list = kept.list;
        this.past = kept.past;
      }
    } catch {
      // Nothing that can be read is kept: it begins with nothing.
    }
    this.lastId = Math.max(0, ...[this.list, ...this.past].flat().map(({ id }) => id));
  }

  /** A pick of a choice that is told from all others for good. */
  made(place, texts) {
    this.lastId += 1;
    return { id: this.lastId, place, texts };
  }

  /** Change the list by a function, as one step that can be undone. */
  change(act) {
    this.mark();
    act(this.list);
    this.keep();
  }

  /** What is changed from now on can be undone to here. */
  mark() {
    this.past.push(structuredClone(this.list));
    if (this.past.length > Picks.MOST_KEPT) this.past.shift();
  }

  /** Go back by one change; whether there was one. */
  undo() {
    if (!this.past.length) return false;
    this.list = this.past.pop();
    this.keep();
    return true;
  }

  keep() {
    const { key, list, past } = this;
    sessionStorage.setItem("picks", JSON.stringify({ key, list, past }));
  }
}
