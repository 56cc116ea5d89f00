// One panel of a trend: a plot of uPlot and its legend, which shows the values
// under the cursor and switches lines on and off.

import uPlot from '../../uplot/uPlot.esm.js';
import {cssColor, h, setText} from '../dom.js';
import {clockText, dateText, numberText} from '../format.js';
import {settings} from '../settings.js';
import {overlayHooks} from './overlay.js';

const kAxisWidth = 58;
const kTimeAxisHeight = 34;
const kDayLabelsMs = 3 * 86400000;  // From here on days, not hours.
const kFont = '11px system-ui, sans-serif';

function timeLabels(u, splits) {
  const span = u.scales.x.max - u.scales.x.min;
  let day = '';
  return splits.map((ms) => {
    const text = clockText(ms);
    const date = dateText(ms);
    const label = span < 600000 ? text : text.slice(0, 5);
    const isNew = date !== day;
    day = date;
    if (span > kDayLabelsMs) return date.slice(5);
    return isNew ? `${label}\n${date}` : label;
  });
}

// As many decimals as the steps have: one of 2.5 has one.
export function numberLabels(u, splits) {
  const step = splits.length > 1 ? Math.abs(splits[1] - splits[0]) : 1;
  const power = Math.floor(Math.log10(step) + 1e-9);
  const digits = step / 10 ** power;
  const halves = Math.abs(digits - Math.round(digits)) > 1e-6 ? 1 : 0;
  const decimals = Math.min(6, Math.max(0, halves - power));
  return splits.map((v) => (v + 0).toFixed(decimals).replace('-', '−'));
}

function axes(hasRight, isLast) {
  const stroke = cssColor('--ink-soft');
  const grid = {stroke: cssColor('--grid'), width: 1};
  const ticks = {show: false};
  const common = {stroke, grid, ticks, font: kFont};
  return [
    {...common, size: isLast ? kTimeAxisHeight : 4, space: 80,
      values: isLast ? timeLabels : (u, splits) => splits.map(() => '')},
    {...common, scale: 'y', size: kAxisWidth, values: numberLabels, space: 24},
    ...(hasRight ? [{...common, scale: 'right', side: 1, size: kAxisWidth,
      grid: {show: false}, values: numberLabels, space: 24}] : []),
  ];
}

// Thresholds stay in sight, and a flat line in the middle.
function rangeOf(panel, scale) {
  if (panel.range && scale === 'y') return panel.range;
  return (u, min, max) => {
    if (min === null) [min, max] = [0, 1];
    if (panel.band) {
      min = Math.min(min, panel.band.low);
      max = Math.max(max, panel.band.high);
    }
    const room = 0.08 * (max - min) || Math.abs(max) * 0.05 || 1;
    return [min - room, max + room];
  };
}

class Panel {
  legend = h('div', {class: 'legend'});
  plotBox = h('div', {class: 'plot'});
  #entries = [];

  /** `handlers`: mousedown(u, event), zoomed(u), reset(). */
  constructor(panel, scene, {isFirst, isLast, width, syncKey, handlers}) {
    this.panel = panel;
    this.scene = scene;
    this.element = h('section', {'class': 'panel', 'aria-label': panel.title},
        h('h2', {}, panel.title), this.legend, this.plotBox);
    const hasRight = panel.lines.some((line) => line.scale === 'right');
    this.#makeLegend();
    this.u = new uPlot({
      width, height: panel.height + (isLast ? kTimeAxisHeight : 4), ms: 1,
      tzDate: (ms) => settings.get('utc') ?
        uPlot.tzDate(new Date(ms), 'Etc/UTC') : new Date(ms),
      legend: {show: false},
      padding: [8, hasRight ? 0 : kAxisWidth, 0, 0],
      scales: {
        x: {time: true}, y: {range: rangeOf(panel, 'y')},
        ...(hasRight ? {right: {range: rangeOf(panel, 'right')}} : {}),
      },
      axes: axes(hasRight, isLast),
      series: [{}, ...panel.lines.map((line) => this.#series(line))],
      cursor: this.#cursor(syncKey, handlers),
      hooks: {...overlayHooks(panel, scene, isFirst),
        setScale: [(u, key) => key === 'x' && handlers.zoomed(u)],
        setCursor: [(u) => this.showValues(u.cursor.idx)]},
    }, this.#columns(), this.plotBox);
    this.u.root.setAttribute('aria-hidden', 'true');
  }

  #series(line) {
    return {
      label: line.label, scale: line.scale ?? 'y',
      stroke: cssColor(line.color), dash: line.dash, width: 1.25,
      points: {show: this.panel.points === true, size: 5}, spanGaps: false,
    };
  }

  #cursor(syncKey, handlers) {
    return {
      sync: {key: syncKey, setSeries: false,
        filters: {pub: (type) => /^mouse(move|leave)$/.test(type)}},
      drag: {x: true, y: false, setScale: true},
      points: {size: 5},
      bind: {
        mousedown: (u, target, handler) => (event) => {
          if (event.shiftKey) handlers.mousedown(u, event);
          else handler(event);
        },
        dblclick: () => handlers.reset,
      },
    };
  }

  #columns() {
    return [this.scene.table.t,
      ...this.panel.lines.map(({column}) => this.scene.table[column])];
  }

  #makeLegend() {
    this.#entries = this.panel.lines.map((line, i) => {
      const swatch = h('span', {'class': 'swatch', 'aria-hidden': 'true'});
      swatch.style.borderTopColor = cssColor(line.color);
      swatch.style.borderTopStyle = line.dash?.length ?
        (line.dash[0] > 3 ? 'dashed' : 'dotted') : 'solid';
      const value = h('span', {class: 'value'});
      const button = h('button', {
        'type': 'button', 'aria-pressed': 'true',
        'title': 'Show or hide this line',
        'onclick': () => this.#toggle(i, button),
      }, swatch, h('span', {}, line.label), value);
      this.legend.append(button);
      return {line, value, button};
    });
  }

  #toggle(i, button) {
    const show = button.getAttribute('aria-pressed') !== 'true';
    button.setAttribute('aria-pressed', String(show));
    this.u.setSeries(i + 1, {show});
  }

  /** The values at an index, else the newest. */
  showValues(index) {
    const {table} = this.scene;
    const at = index ?? table.t.length - 1;
    for (const {line, value, button} of this.#entries) {
      const number = table[line.column]?.[at];
      const missing = number === null || number === undefined;
      if (this.panel.key === 'decision') {
        const fits = missing ? '' : this.#fits(number);
        setText(value, fits);
        value.title = missing ? '' : number.toFixed(2);
        button.classList.toggle('quiet', fits === 'excluded');
      } else {
        setText(value, missing ? '–' :
          `${numberText(number)} ${line.unit}`.trim());
      }
    }
  }

  // The rivals of a name are those that are not excluded.
  #fits(d) {
    const {threshold: T} = this.panel;
    return T === null ? '' : d >= T ? 'explains it' :
      d >= T / 2 ? 'not excluded' : 'excluded';
  }

  /** Draws the scene anew; the scale of time is the caller's. */
  update() {
    if (this.panel.key === 'decision') this.#emphasise();
    this.u.setData(this.#columns(), false);
    this.showValues(this.u.cursor.idx);
  }

  // Makes the lines of present explanations stand out.
  #emphasise() {
    const {threshold} = this.panel;
    this.panel.lines.forEach(({column}, i) => {
      const strong = this.scene.table[column]?.at(-1) >= threshold;
      this.u.series[i + 1].width = strong ? 2 : 1.25;
      this.#entries[i].button.classList.toggle('strong', strong);
    });
  }

  destroy() {
    this.u.destroy();
  }
}

/** Panels below each other on one axis of time, as wide as there is room. */
export class PanelStack {
  element = h('div', {class: 'panels'});
  panels = [];
  #resize = new ResizeObserver(() => this.#fit());

  constructor() {
    this.#resize.observe(this.element);
  }

  /** `list`: what panelsOf() gives; `handlers` as for Panel. */
  show(list, scene, syncKey, handlers) {
    this.#clear();
    const width = Math.max(280, this.element.clientWidth || 800);
    this.panels = list.map((panel, i) => new Panel(panel, scene, {
      isFirst: i === 0, isLast: i === list.length - 1, width, syncKey,
      handlers}));
    this.element.replaceChildren(...this.panels.map((panel) => panel.element));
  }

  destroy() {
    this.#resize.disconnect();
    this.#clear();
  }

  #clear() {
    this.panels.forEach((panel) => panel.destroy());
    this.panels = [];
  }

  #fit() {
    const width = this.element.clientWidth;
    for (const {u} of this.panels) {
      if (Math.abs(u.width - width) > 1) u.setSize({width, height: u.height});
    }
  }
}
