// Figures of the alarms of a time.

import {barCell, barChart} from '../charts/bars.js';
import {factList, h} from '../dom.js';
import {faultTitle, members} from '../faults.js';
import {dateText, durationText} from '../format.js';
import {dataTable, timeCell, valveLink} from './table.js';

const kDayMs = 86400000;
const kMaxDays = 120;  // In a chart.
const kTopRows = 10;

/** Days without an alarm are days, too. */
function everyDay(perDay, {since_ms: since, until_ms: until}) {
  const known = new Map(perDay.map((day) => [day.day, day]));
  const end = until ?? Date.now();
  const days = [];
  for (let ms = since - since % kDayMs; ms < end; ms += kDayMs) {
    const name = new Date(ms).toISOString().slice(0, 10);
    days.push(known.get(name) ?? {day: name, episodes: 0, alarm_s: 0});
  }
  return days;
}

const countText = (n) => Number(n) > 0 ? String(Number(n)) : '–';

const countColumn = (text, name) =>
  ({text, class: 'num wide', cell: (row) => countText(row[name])});

// A column of numbers with bars, each a share of the greatest.
function barColumn(text, rows, name, textOf = String) {
  const most = Math.max(0, ...rows.map((row) => row[name]));
  return {text, cell: (row) => barCell(row[name], most, textOf(row[name]))};
}

const mostFrequent = (rows) =>
  [...rows].sort((a, b) => b.episodes - a.episodes).slice(0, kTopRows);

function valveTable(valves) {
  const top = mostFrequent(valves);
  return dataTable('Most frequent valves', [
    {text: 'Valve', header: true, cell: (row) => valveLink(row.valve)},
    barColumn('Episodes', top, 'episodes'),
    barColumn('Time in alarm', top, 'alarm_s', (s) => durationText(1000 * s)),
    countColumn('Chattering', 'chattering'),
    countColumn('Standing', 'standing'),
    {text: 'Last', class: 'wider', cell: (row) => timeCell(row.last_ms)},
  ], top);
}

function faultTable(faults) {
  const top = mostFrequent(faults);
  return dataTable('Most frequent faults', [
    // Without a name: unlike any known fault, or ended before it had one.
    {text: 'Fault', header: true, cell: (row) =>
      members(row.fault).length > 0 ? faultTitle(row.fault) : row.name},
    barColumn('Episodes', top, 'episodes'),
    countColumn('Labelled right', 'right'),
    countColumn('Labelled wrong', 'wrong'),
  ], top);
}

function keyFigures(figures, days) {
  const {labelled, valves, gaps} = figures;
  const episodes = days.reduce((sum, day) => sum + day.episodes, 0);
  const sum = (name) => valves.reduce((n, v) => n + Number(v[name] ?? 0), 0);
  const judged = labelled.true + labelled.false;
  return factList([
    ['Episodes', String(episodes)],
    ['A day', days.length === 0 ? '–' : (episodes / days.length).toFixed(
        episodes < days.length ? 2 : 1)],
    ['Time in alarm', durationText(1000 * sum('alarm_s'))],
    ['Still open', String(sum('open'))],
    ['Chattering', String(sum('chattering'))],
    ['Standing', String(sum('standing'))],
    ['False alarms', judged === 0 ? 'none labelled' :
      `${labelled.false} of ${judged} labelled ` +
        `(${Math.round(100 * labelled.false / judged)} %)`],
    ['Not labelled', String(labelled.none)],
    ['Gaps in the data', gaps?.length ? `${gaps.length}, ${durationText(
        gaps.reduce((n, g) => n + g.to_ms - g.from_ms, 0))}` : 'none'],
  ]);
}

export function statisticsSection(figures, time) {
  const days = everyDay(figures.per_day, time);
  const drawn = days.slice(-kMaxDays);
  return h('section', {'aria-label': 'Statistics'},
      h('h2', {}, `${dateText(time.since_ms)} to ` +
        (time.until_ms ? dateText(time.until_ms) : 'now')),
      keyFigures(figures, days),
      h('div', {class: 'figures'},
          barChart('Episodes per day', '', drawn.map((day) =>
            ({name: day.day, value: day.episodes})), true),
          barChart('Time in alarm per day [h]', 'h', drawn.map((day) =>
            ({name: day.day, value: day.alarm_s / 3600}))),
          figures.valves.length > 0 && valveTable(figures.valves),
          figures.faults.length > 0 && faultTable(figures.faults)),
      h('p', {class: 'hint'}, 'Days are UTC. Chattering: episodes that came ' +
        'three times or more within half an hour; standing: those that ' +
        'lasted more than a day.'));
}
