// Panels of a trend on one axis of time: zoom by dragging, pan by Shift and
// dragging, both by keys and buttons; follows the newest until told otherwise.

import {button, h, replace, setText} from '../dom.js';
import {markWord} from '../faults.js';
import {durationText, timeText} from '../format.js';
import {settings} from '../settings.js';
import {reasonText} from './overlay.js';
import {PanelStack} from './panel.js';
import {panelsOf} from './panels.js';

const kMinSpanMs = 5000;
let count = 0;

const linesOf = (panels) => panels.flatMap(({lines}) =>
  lines.map(({column}) => column)).join();

export class Timeline {
  element;
  #stack = new PanelStack();
  #scene = {table: {t: []}, gaps: [], marks: [], priority: 3};
  #panelBox = this.#stack.element;
  #buttons = h('div', {
    'class': 'chart-tools', 'role': 'group', 'aria-label': 'Time shown'});
  #summary = h('p', {class: 'hint trend-summary'});
  #spanMs;  // Length of the window that follows; null: all.
  #window = null;  // Chosen by the user; null: follow.
  #setting = false;
  #syncKey = `trend${++count}`;
  #hidden = new Set(['process']);
  #everyFault = false;
  #shownLines = '';
  #data;
  #repaint = ({detail}) => {
    if (detail === 'paper') this.rebuild();
  };

  /**
   * `live`: the newest is where it goes on; else all of it is shown.
   * `silentMs()`: for how long nothing was heard.
   */
  constructor(data, {live, nowMs, silentMs, describe}) {
    this.#data = data;
    this.#spanMs = live ? 15 * 60000 : null;
    this.live = live;
    this.nowMs = nowMs;
    this.silentMs = silentMs;
    this.#panelBox.tabIndex = 0;
    this.#panelBox.setAttribute('role', 'application');
    this.#panelBox.setAttribute('aria-roledescription', 'trend');
    this.#panelBox.setAttribute('aria-label', describe);
    this.#panelBox.addEventListener('keydown', (event) => this.#key(event));
    this.#panelBox.addEventListener('wheel', (event) => this.#wheel(event),
        {passive: false});
    this.element = h('div', {class: 'timeline'}, this.#buttons, this.#panelBox,
        this.#summary);
    this.#makeButtons();
    settings.addEventListener('change', this.#repaint);
  }

  destroy() {
    settings.removeEventListener('change', this.#repaint);
    this.#stack.destroy();
  }

  /** Channels or faults are others: panels anew. */
  rebuild() {
    this.#readScene();
    const all = this.#panelsNow();
    this.#shownLines = linesOf(all);
    this.hasProcess = all.some((panel) => panel.key === 'process');
    this.#stack.show(all.filter((panel) => !this.#hidden.has(panel.key)),
        this.#scene, this.#syncKey, {
          mousedown: (u, event) => this.#pan(u, event),
          zoomed: (u) => this.#zoomed(u),
          reset: () => this.showAll(),
        });
    this.#makeButtons();
    this.update();
  }

  /** Instants, gaps or marks have changed. */
  update() {
    if (this.panels.length === 0) return;
    this.#readScene();
    if (linesOf(this.#panelsNow()) !== this.#shownLines) {
      this.rebuild();
      return;
    }
    this.#summarise();
    this.panels.forEach((panel) => panel.update());
    this.#apply(this.#window ?? this.#following());
  }

  get panels() {
    return this.#stack.panels;
  }

  showAll() {
    this.#spanMs = null;
    this.#window = null;
    this.update();
    this.#makeButtons();
  }

  follow(spanMs) {
    this.#spanMs = spanMs;
    this.#window = null;
    this.update();
    this.#makeButtons();
  }

  #panelsNow() {
    return panelsOf(this.#data, this.#scene.table, this.#everyFault);
  }

  #readScene() {
    const gaps = this.#data.allGaps();
    Object.assign(this.#scene, {
      gaps, table: this.#data.columns ? this.#data.table(gaps) : {t: []},
      marks: this.#data.marks, priority: this.#data.priority,
    });
  }

  // The picture in words.
  #summarise() {
    const {size, columns, marks} = this.#data;
    const {gaps} = this.#scene;
    const list = (items, text) => items.slice(-5).map(text).join('; ');
    setText(this.#summary, size === 0 ? 'No samples yet.' :
      `${size} instants from ${timeText(columns.t[0])} to ` +
      `${timeText(columns.t.at(-1))}. ` + (gaps.length === 0 ? 'No gaps. ' :
        `${gaps.length} ${gaps.length === 1 ? 'gap' : 'gaps'}: ` +
        list(gaps, (gap) => `${timeText(gap.from_ms)} ${reasonText(gap)}` +
          (gap.to_ms === null ? '' :
            `, ${durationText(gap.to_ms - gap.from_ms)}`)) + '. ') +
      (marks.length === 0 ? '' : 'Marks: ' + list(marks, (mark) =>
        `${timeText(mark.t_ms)} ${markWord(mark.kind, mark.text)}`) + '.'));
  }

  // While nothing comes the window goes on, so that the gap is seen to grow.
  #following() {
    const {t} = this.#scene.table;
    const first = t[0] ?? this.nowMs() - 60000;
    const last = t.at(-1) ?? this.nowMs();
    const end = last + (this.live ? this.silentMs() : 0);
    const begin = this.#spanMs === null ? first : end - this.#spanMs;
    return [begin, Math.max(end, begin + kMinSpanMs)];
  }

  #apply([min, max]) {
    this.#setting = true;
    for (const {u} of this.panels) u.setScale('x', {min, max});
    // Scales are set at the end of the task.
    queueMicrotask(() => this.#setting = false);
  }

  #zoomed(u) {
    const {min, max} = u.scales.x;
    if (this.#setting || this.panels.length === 0 || min === null) return;
    this.#look([min, max]);
  }

  #look([min, max]) {
    if (max - min < kMinSpanMs) {
      const middle = (min + max) / 2;
      [min, max] = [middle - kMinSpanMs / 2, middle + kMinSpanMs / 2];
    }
    this.#window = [min, max];
    this.#apply(this.#window);
    this.#makeButtons();
  }

  #shown() {
    return this.#window ?? this.#following();
  }

  shift(share) {
    const [min, max] = this.#shown();
    const step = share * (max - min);
    this.#look([min + step, max + step]);
  }

  /** Around `at` (ms), by default the middle. */
  zoom(factor, at = null) {
    const [min, max] = this.#shown();
    const centre = at ?? (min + max) / 2;
    this.#look([centre + (min - centre) * factor,
      centre + (max - centre) * factor]);
  }

  #pan(u, event) {
    event.preventDefault();
    const [min, max] = this.#shown();
    const perPixel = (max - min) / u.over.clientWidth;
    const move = ({clientX}) => {
      const step = (event.clientX - clientX) * perPixel;
      this.#look([min + step, max + step]);
    };
    addEventListener('pointermove', move);
    addEventListener('pointerup', () =>
      removeEventListener('pointermove', move), {once: true});
  }

  #wheel(event) {
    if (!event.ctrlKey && !event.shiftKey) return;
    event.preventDefault();
    if (event.shiftKey) {
      this.shift(Math.sign(event.deltaY || event.deltaX) * 0.1);
      return;
    }
    const u = this.panels[0]?.u;
    if (!u) return;
    const {left} = u.over.getBoundingClientRect();
    this.zoom(event.deltaY > 0 ? 1.25 : 0.8,
        u.posToVal(event.clientX - left, 'x'));
  }

  #key(event) {
    if (event.target !== this.#panelBox) return;
    const actions = {
      'ArrowLeft': () => this.shift(-0.2), 'ArrowRight': () => this.shift(0.2),
      '+': () => this.zoom(0.5), '-': () => this.zoom(2),
      'Home': () => this.showAll(), 'End': () => this.follow(this.#spanMs),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    event.stopPropagation();
    actions[event.key]();
  }

  #makeButtons() {
    const focused = this.#buttons.contains(document.activeElement) ?
      document.activeElement.title : null;
    const tool = (text, action, title, pressed) => button(text, action, {
      title, 'aria-label': /\w/.test(text) ? null : title,
      'aria-pressed': pressed === undefined ? null : String(pressed)});
    const following = this.#window === null;
    const minutes = this.live ? [5, 15, 60] : [];
    replace(this.#buttons,
        minutes.map((m) => tool(`${m} min`, () => this.follow(m * 60000),
            `Follow the last ${m} minutes`,
            following && this.#spanMs === m * 60000)),
        tool('All', () => this.showAll(), 'Show all there is',
            following && this.#spanMs === null),
        tool('◀', () => this.shift(-0.2), 'Earlier (key ←)'),
        tool('▶', () => this.shift(0.2), 'Later (key →)'),
        tool('+', () => this.zoom(0.5), 'Zoom in (key +, Ctrl and wheel)'),
        tool('−', () => this.zoom(2), 'Zoom out (key −, Ctrl and wheel)'),
        this.hasProcess ? tool('P1 P2 T1', () => this.#toggleProcess(),
            'Show pressures and temperature',
            !this.#hidden.has('process')) : null,
        this.#data.meta.faults.length > 0 ? tool('All faults', () => {
          this.#everyFault = !this.#everyFault;
          this.rebuild();
        }, 'Show the decision factors of all faults', this.#everyFault) : null,
        following || !this.live ? null :
          h('span', {class: 'paused'}, 'Paused: not following'));
    if (focused) {
      [...this.#buttons.children].find((b) => b.title === focused)?.focus();
    }
  }

  #toggleProcess() {
    if (!this.#hidden.delete('process')) this.#hidden.add('process');
    this.rebuild();
  }
}
