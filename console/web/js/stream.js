// Server-sent events that reconnect by themselves. Over fetch and not
// EventSource, which tells neither the pings nor the reason of a refusal.

import {errorOf, url} from './api.js';

const kSilenceMs = 12000;
const kFirstDelayMs = 500;
const kMaxDelayMs = 10000;
// A browser has six connections to a monitor and a monitor has room for sixteen
// pages: one that nobody looks at gives its own back.
const kHiddenMs = 20000;

/** Cuts "event: a\ndata: b\n\n" into {type, data}; text may come in pieces. */
export class EventParser {
  #rest = '';

  push(text) {
    const blocks = (this.#rest + text).replaceAll('\r\n', '\n').split('\n\n');
    this.#rest = blocks.pop();
    return blocks.map((block) => this.#parse(block))
        .filter((event) => event.data !== '');
  }

  #parse(block) {
    let type = 'message';
    const data = [];
    for (const line of block.split('\n')) {
      if (line.startsWith('event:')) type = line.slice(6).trim();
      if (line.startsWith('data:')) data.push(line.slice(5).trim());
    }
    return {type, data: data.join('\n')};
  }
}

/**
 * Emits 'message' {type, data} and 'state': connected, reason, heardMs (when
 * anything was heard last) and retryMs (when it tries again).
 */
export class Stream extends EventTarget {
  connected = false;
  heardMs = null;
  reason = '';
  retryMs = null;
  resting = false;  // Nobody looks: the connection is given back.
  #valve = null;
  #abort = null;
  #previous = null;  // Is listened to until the next one speaks.
  #delayMs = kFirstDelayMs;
  #timer = null;
  #watchdog = null;
  #hiding = null;

  constructor() {
    super();
    addEventListener('online', () => this.retryNow());
    document.addEventListener('visibilitychange', () => this.#visibility());
    if (document.hidden) this.#visibility();
  }

  /** Listens from now on; with the samples of `valve` unless null. */
  open(valve) {
    if (this.#abort && valve === this.#valve) return;
    this.#valve = valve;
    if (!this.resting) this.#connect();
  }

  retryNow() {
    if (this.#timer) this.#connect();
  }

  #visibility() {
    clearTimeout(this.#hiding);
    if (document.hidden) {
      this.#hiding = setTimeout(() => this.#rest(), kHiddenMs);
    } else if (this.resting) {
      this.resting = false;
      this.#connect();
    } else {
      this.retryNow();
    }
  }

  #rest() {
    this.resting = true;
    clearTimeout(this.#timer);
    clearTimeout(this.#watchdog);
    this.#timer = null;
    const abort = this.#abort;
    this.#abort = null;  // Its end is no loss.
    abort?.abort();
    this.#previous?.abort();
    this.connected = false;
    this.dispatchEvent(new Event('state'));
  }

  async #connect() {
    clearTimeout(this.#timer);
    this.#timer = null;
    this.#previous?.abort();
    this.#previous = this.#abort;
    const abort = this.#abort = new AbortController();
    try {
      await this.#listen(abort);
      throw new Error('the monitor closed the connection');
    } catch (error) {
      if (abort !== this.#abort) return;  // A newer connection is at work.
      this.#lost(error);
    }
  }

  async #listen(abort) {
    this.#watch();
    const response = await fetch(
        url('/stream', {valve: this.#valve}),
        {signal: abort.signal, cache: 'no-store',
          headers: {Accept: 'text/event-stream'}});
    if (response.status === 401) location.reload();  // The proxy asks again.
    if (!response.ok) throw await errorOf(response);
    const reader = response.body.pipeThrough(new TextDecoderStream())
        .getReader();
    const parser = new EventParser();
    for (;;) {
      const {value, done} = await reader.read();
      if (done) return;
      this.#heard(abort);
      for (const {type, data} of parser.push(value)) {
        this.dispatchEvent(new CustomEvent(
            'message', {detail: {type, data: JSON.parse(data)}}));
      }
    }
  }

  #heard(abort) {
    if (abort === this.#abort) {
      this.#previous?.abort();
      this.#previous = null;
    }
    this.heardMs = Date.now();
    this.#watch();
    if (this.connected) return;
    this.connected = true;
    this.#delayMs = kFirstDelayMs;
    this.retryMs = null;
    this.dispatchEvent(new Event('state'));
  }

  #watch() {
    clearTimeout(this.#watchdog);
    this.#watchdog = setTimeout(() => {
      this.reason = 'nothing was heard for 12 s';
      this.#abort.abort();
    }, kSilenceMs);
  }

  #lost(error) {
    clearTimeout(this.#watchdog);
    this.#previous?.abort();
    this.#previous = null;
    this.connected = false;
    if (error.name !== 'AbortError') {
      this.reason = error.status ? error.message :
        'the monitor does not answer';
    }
    const delay = error.retryAfterS ? 1000 * error.retryAfterS :
      this.#delayMs * (0.8 + 0.4 * Math.random());
    this.#delayMs = Math.min(2 * this.#delayMs, kMaxDelayMs);
    this.retryMs = Date.now() + delay;
    this.#timer = setTimeout(() => this.#connect(), delay);
    this.dispatchEvent(new Event('state'));
  }
}
