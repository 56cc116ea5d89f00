// Figures of the alarms of a time.

import {barCell, barChart} from '../charts/bars.js';
import {h} from '../dom.js';
import {faultTitle} from '../faults.js';
import {dateText, durationText} from '../format.js';
import {link} from '../route.js';
import {scrollable, timeCell} from './table.js';

const kDayMs = 86400000;
const kMostDays = 120;
const kTopRows = 10;

/** Days without an alarm are days, too. */
function everyDay(perDay, {since_ms: since, until_ms: until}) {
  const known = new Map(perDay.map((day) => [day.day, day]));
  const end = until ?? Date.now();
  const days = [];
  const first = Math.max(since, end - kMostDays * kDayMs);
  for (let ms = first - first % kDayMs; ms < end; ms += kDayMs) {
    const name = new Date(ms).toISOString().slice(0, 10);
    days.push(known.get(name) ?? {day: name, episodes: 0, alarm_s: 0});
  }
  return days;
}

function table(caption, heads, rows) {
  return scrollable(caption, h('table', {class: 'small'},
      h('caption', {}, caption),
      h('thead', {}, h('tr', {}, heads.map((text) =>
        h('th', {scope: 'col'}, text)))),
      h('tbody', {}, rows)));
}

function valveTable(valves) {
  const top = [...valves].sort((a, b) => b.episodes - a.episodes)
      .slice(0, kTopRows);
  const mostEpisodes = Math.max(0, ...top.map((v) => v.episodes));
  const mostTime = Math.max(0, ...top.map((v) => v.alarm_s));
  return table('Most frequent valves', ['Valve', 'Episodes', 'Time in alarm',
    'Chattering', 'Standing', 'Last'], top.map((v) => h('tr', {},
      h('th', {scope: 'row'}, h('a', {href: link('valve', v.valve)}, v.valve)),
      h('td', {}, barCell(v.episodes, mostEpisodes, String(v.episodes))),
      h('td', {}, barCell(v.alarm_s, mostTime,
          durationText(1000 * v.alarm_s))),
      h('td', {class: 'num'}, countText(v.chattering)),
      h('td', {class: 'num'}, countText(v.standing)),
      h('td', {}, timeCell(v.last_ms)))));
}

const countText = (n) => Number(n) > 0 ? String(Number(n)) : '–';

function faultTable(faults) {
  const top = [...faults].sort((a, b) => b.episodes - a.episodes)
      .slice(0, kTopRows);
  const most = Math.max(0, ...top.map((f) => f.episodes));
  return table('Most frequent faults',
      ['Fault', 'Episodes', 'Labelled right', 'Labelled wrong'],
      top.map((f) => h('tr', {},
          h('th', {scope: 'row'}, faultTitle(f.fault)),
          h('td', {}, barCell(f.episodes, most, String(f.episodes))),
          h('td', {class: 'num'}, countText(f.right)),
          h('td', {class: 'num'}, countText(f.wrong)))));
}

function keyFigures(figures, days) {
  const {labelled, valves, gaps} = figures;
  const episodes = days.reduce((sum, day) => sum + day.episodes, 0);
  const sum = (name) => valves.reduce((n, v) => n + Number(v[name] ?? 0), 0);
  const judged = labelled.true + labelled.false;
  const facts = [
    ['Episodes', String(episodes)],
    ['A day', days.length > 0 ? (episodes / days.length).toFixed(1) : '–'],
    ['Time in alarm', durationText(1000 * sum('alarm_s'))],
    ['Open now', String(sum('open'))],
    ['Chattering', String(sum('chattering'))],
    ['Standing', String(sum('standing'))],
    ['False alarms', judged === 0 ? 'none labelled' :
      `${labelled.false} of ${judged} labelled ` +
        `(${Math.round(100 * labelled.false / judged)} %)`],
    ['Not labelled', String(labelled.none)],
    ['Gaps in the data', gaps?.length ? `${gaps.length}, ${durationText(
        gaps.reduce((n, g) => n + g.to_ms - g.from_ms, 0))}` : 'none'],
  ];
  return h('dl', {class: 'facts'}, facts.map(([name, value]) =>
    h('div', {}, h('dt', {}, name), h('dd', {}, value))));
}

export function statisticsSection(figures, time) {
  const days = everyDay(figures.per_day, time);
  return h('section', {'aria-label': 'Statistics'},
      h('h2', {}, `${dateText(time.since_ms)} to ` +
        (time.until_ms ? dateText(time.until_ms) : 'now')),
      keyFigures(figures, days),
      h('div', {class: 'figures'},
          barChart('Episodes per day', '', days.map((day) =>
            ({name: day.day, value: day.episodes})), true),
          barChart('Time in alarm per day [h]', 'h', days.map((day) =>
            ({name: day.day, value: day.alarm_s / 3600}))),
          valveTable(figures.valves), faultTable(figures.faults)),
      h('p', {class: 'hint'}, 'Days are UTC. Chattering: episodes that came ' +
        'three times or more within half an hour; standing: those that ' +
        'lasted more than a day.'));
}
