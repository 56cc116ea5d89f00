// Months of a valve, a point a day: residuals, normality, travel, dead band,
// hours in alarm, what was counted on the last day, and how long until a limit
// where a trend is significant.

import {getOptional, path} from '../api.js';
import {PanelStack} from '../charts/panel.js';
import {h} from '../dom.js';
import {namurText} from '../faults.js';
import {numberText, unitText} from '../format.js';
import {dataTable} from './table.js';

const kMinDays = 2;

function panelsOf(health) {
  const residuals = health.channels.map(({signal, unit}, c) => ({
    key: `mean${c}`, height: 110, points: true,
    title: `Mean residual of ${signal} a day [${unitText(unit) || '-'}]`,
    lines: [{column: `mean${c}`, label: 'mean', unit: unitText(unit),
      color: '--s1'}, {column: `rms${c}`, label: 'rms', unit: unitText(unit),
      color: '--s5', dash: [6, 3]}],
  }));
  return [...residuals, {
    key: 'd0', title: 'How well normal explains the data, mean of the day', height: 90,
    points: true, range: [-0.03, 1.05],
    lines: [{column: 'd0', label: 'normal', unit: '', color: '--s1'}],
  }, {
    key: 'travel', title: 'Travel [strokes] left, hours in alarm right',
    height: 100, points: true,
    lines: [{column: 'travel_strokes', label: 'travel', unit: 'strokes',
      color: '--s2'}, {column: 'alarm_h', label: 'in alarm', unit: 'h',
      color: '--s3', scale: 'right'}],
  }, {
    key: 'band', title: 'Dead band and dynamic error band [%], mean of the day',
    height: 90, points: true,
    lines: [{column: 'dead_band', label: 'dead band', unit: '%',
      color: '--s4'}, {column: 'error_band', label: 'error band', unit: '%',
      color: '--s5', dash: [6, 3]}],
  }];
}

function tableOf(health) {
  const table = {t: health.t_ms, d0: health.d0, alarm_h: health.alarm_h,
    travel_strokes: health.travel_strokes, dead_band: health.dead_band,
    error_band: health.error_band};
  health.channels.forEach(({mean, rms}, c) => {
    table[`mean${c}`] = mean;
    table[`rms${c}`] = rms;
  });
  return table;
}

const withUnit = (value, {unit}) => value === null ? '–' :
  `${numberText(value)} ${unitText(unit)}`;

// Counters: column of the answer, words, unit.
const kCounts = [
  ['travel_strokes', 'Travel', 'strokes'], ['reversals', 'Reversals', ''],
  ['auto_h', 'In AUTO', 'h'], ['shut_h', 'Shut', 'h'], ['open_h', 'Open', 'h'],
  ['at_limit', 'CV at an end', '%'], ['slip_jumps', 'Slip jumps', ''],
  ['slip_jump', 'Mean slip jump', '%'], ['dead_band', 'Dead band', '%'],
  ['error_band', 'Dynamic error band', '%'], ['delay', 'Dead time', 's'],
  ['t63', 'T63', 's'], ['t86', 'T86', 's'], ['overshoot', 'Overshoot', '%'],
  ['travel_gain', 'Travel gain', ''],
  ['single_readings', 'Single wrong readings', 'an hour'],
];

function countsOf(health) {
  const last = health.t_ms.length - 1;
  return kCounts.map(([key, text, unit]) => ({text, unit,
    value: health[key][last], exceeded: health.exceeded[last].includes(key)}))
      .filter(({value}) => value !== null);
}

// Most valves exceed no limit: then there is no column for it.
const countsTable = (rows) => dataTable('Counts', [
  {text: 'Count', header: true, cell: (row) => row.text},
  {text: 'Value', cell: ({value, unit}) =>
    `${Number.isInteger(value) ? value : numberText(value)} ${unit}`},
  ...rows.some((row) => row.exceeded) ? [{text: 'Limit', cell: (row) =>
    row.exceeded ? 'exceeded' : ''}] : [],
], rows);

const kTrendColumns = [
  {text: 'Limit', header: true, cell: (row) => row.limit.replace('=', ' = ')
    .replace('-', '−').replace(/\s*%/, ' %')},
  {text: 'Now', cell: (row) => withUnit(row.now, row)},
  {text: 'A day', cell: (row) => withUnit(row.per_day, row)},
  {text: 'Reaches it', cell: (row) => row.text},
];

export class HealthSection {
  element = h('section', {});
  #stack = new PanelStack();
  #gone = false;

  /** @param away says why nobody judges the valve now, or nothing. */
  constructor(valve, away) {
    this.#load(valve, away);
  }

  destroy() {
    this.#gone = true;
    this.#stack.destroy();
  }

  async #load(valve, away) {
    let health = null;
    try {
      health = await getOptional(path('valves', valve, 'health'));
    } catch {
      return;  // The rest of the page says what is wrong.
    }
    if (health === null || health.t_ms.length === 0 || this.#gone) return;
    this.element.append(
        h('h2', {}, `Counts of the last ${health.step}`),
        h('p', {}, 'Status (NAMUR NE 107): ' + (away() ?
          `check function, ${away()}` : namurText(health.status.at(-1)))),
        countsTable(countsOf(health)),
        h('h2', {}, 'Months'),
        dataTable('Trends to limits', kTrendColumns, health.trends));
    if (health.t_ms.length < kMinDays) {
      this.element.append(h('p', {class: 'hint'},
          'Charts come with the second day.'));
      return;
    }
    this.element.append(this.#stack.element);
    const scene = {table: tableOf(health), gaps: [], marks: []};
    this.#stack.show(panelsOf(health), scene, `health-${health.valve}`, {
      mousedown() {}, zoomed() {}, reset: () => this.#stack.panels.forEach(
          ({u}) => u.setData(u.data))});
    this.#stack.panels.forEach((panel) => panel.showValues(null));
  }
}
