// The parts that all views share: an element, a title, and an end.

import {isPressed} from '../dom.js';
import {onKey} from '../shortcuts.js';

/** Listeners, timers and keys of a view go with it. */
export class View {
  title = '';
  element = null;
  #abort = new AbortController();
  #ends = [];

  /** The user has left the view: what still comes is for nobody. */
  get gone() {
    return this.#abort.signal.aborted;
  }

  on(target, type, action) {
    target.addEventListener(type, (event) => action(event.detail),
        {signal: this.#abort.signal, passive: true});
  }

  every(periodMs, action) {
    const timer = setInterval(action, periodMs);
    this.atEnd(() => clearInterval(timer));
  }

  key(key, text, action) {
    this.atEnd(onKey(key, text, action));
  }

  atEnd(action) {
    this.#ends.push(action);
  }

  destroy() {
    this.#abort.abort();
    this.#ends.forEach((end) => end());
  }
}

/**
 * A function that calls `action` with the next frame, once however often; not
 * while something is pressed, which would be gone before its click.
 */
export function oncePerFrame(view, action) {
  let frame = 0;
  view.atEnd(() => cancelAnimationFrame(frame));
  const run = () => {
    frame = isPressed() ? requestAnimationFrame(run) : 0;
    if (frame === 0) action();
  };
  return () => frame ||= requestAnimationFrame(run);
}
