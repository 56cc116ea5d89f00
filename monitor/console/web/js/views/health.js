// Months of a valve, a point a day: residuals, normality, travel, hours in
// alarm, and how long until a limit where a trend is significant.

import {getOptional, path} from '../api.js';
import {Panel} from '../charts/panel.js';
import {unitText} from '../charts/panels.js';
import {h} from '../dom.js';
import {numberText} from '../format.js';
import {scrollable} from './table.js';

const kLeastDays = 2;

function panelsOf(health) {
  const residuals = health.channels.map(({signal, unit}, c) => ({
    key: `mean${c}`, height: 110, points: true,
    title: `Mean residual of ${signal} a day [${unitText(unit) || '-'}]`,
    lines: [{column: `mean${c}`, label: 'mean', unit: unitText(unit),
      color: '--s1'}, {column: `rms${c}`, label: 'rms', unit: unitText(unit),
      color: '--s5', dash: [6, 3]}],
  }));
  return [...residuals, {
    key: 'd0', title: 'Factor d of normal, mean of the day', height: 90,
    points: true, range: [-0.03, 1.05],
    lines: [{column: 'd0', label: 'normal', unit: '', color: '--s1'}],
  }, {
    key: 'travel', title: 'Travel [strokes] left, hours in alarm right',
    height: 100, points: true,
    lines: [{column: 'travel_strokes', label: 'travel', unit: 'strokes',
      color: '--s2'}, {column: 'alarm_h', label: 'in alarm', unit: 'h',
      color: '--s3', scale: 'right'}],
  }];
}

function tableOf(health) {
  const table = {t: health.t_ms, d0: health.d0, alarm_h: health.alarm_h,
    travel_strokes: health.travel_strokes};
  health.channels.forEach(({mean, rms}, c) => {
    table[`mean${c}`] = mean;
    table[`rms${c}`] = rms;
  });
  return table;
}

function trendTable(trends) {
  const heads = ['Limit', 'Now', 'A day', 'Reaches it'];
  const withUnit = (value, {unit}) => value === null ? '–' :
    `${numberText(value)} ${unitText(unit)}`;
  return scrollable('Trends to limits', h('table', {class: 'small'},
      h('caption', {}, 'Trends to limits'),
      h('thead', {}, h('tr', {}, heads.map((text) =>
        h('th', {scope: 'col'}, text)))),
      h('tbody', {}, trends.map((trend) => h('tr', {},
          h('th', {scope: 'row'}, trend.limit.replace('=', ' = ')),
          h('td', {}, withUnit(trend.now, trend)),
          h('td', {}, withUnit(trend.per_day, trend)),
          h('td', {}, trend.text))))));
}

export class HealthSection {
  element = h('section', {});
  #panels = [];
  #resize = new ResizeObserver(() => this.#fit());
  #gone = false;

  constructor(valve) {
    this.#load(valve);
  }

  destroy() {
    this.#gone = true;
    this.#resize.disconnect();
    this.#panels.forEach((panel) => panel.destroy());
  }

  async #load(valve) {
    let health = null;
    try {
      health = await getOptional(path('valves', valve, 'health'));
    } catch {
      return;  // The rest of the page says what is wrong.
    }
    if (health === null || health.t_ms.length === 0 || this.#gone) return;
    this.element.append(h('h2', {}, 'Months'), trendTable(health.trends));
    if (health.t_ms.length < kLeastDays) {
      this.element.append(h('p', {class: 'hint'},
          'Charts come with the second day.'));
      return;
    }
    this.#draw(health);
  }

  #draw(health) {
    const box = h('div', {class: 'panels'});
    this.element.append(box);
    const scene = {table: tableOf(health), gaps: [], marks: []};
    const panels = panelsOf(health);
    const width = Math.max(280, box.clientWidth || 800);
    this.#panels = panels.map((panel, i) => new Panel(panel, scene, {
      isFirst: i === 0, isLast: i === panels.length - 1, width,
      syncKey: `health-${health.valve}`,
      handlers: {mousedown() {}, zoomed() {}, reset: () => this.#panels.forEach(
          ({u}) => u.setData(u.data))},
    }));
    box.append(...this.#panels.map((panel) => panel.element));
    this.#panels.forEach((panel) => panel.showValues(null));
    this.#resize.observe(box);
  }

  #fit() {
    for (const {u, element} of this.#panels) {
      const width = element.clientWidth;
      if (Math.abs(u.width - width) > 1) u.setSize({width, height: u.height});
    }
  }
}
