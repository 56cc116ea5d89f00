// Numbers, times and durations as text.

import {settings} from './settings.js';

const two = (n) => String(n).padStart(2, '0');

/** The parts of a time in the zone that was chosen. */
function parts(ms) {
  const t = new Date(ms);
  return settings.get('utc') ?
    [t.getUTCFullYear(), t.getUTCMonth() + 1, t.getUTCDate(),
      t.getUTCHours(), t.getUTCMinutes(), t.getUTCSeconds()] :
    [t.getFullYear(), t.getMonth() + 1, t.getDate(),
      t.getHours(), t.getMinutes(), t.getSeconds()];
}

export function zoneName() {
  if (settings.get('utc')) return 'UTC';
  const minutes = -new Date().getTimezoneOffset();
  if (minutes === 0) return 'UTC+0';
  const size = Math.abs(minutes);
  return `UTC${minutes < 0 ? '-' : '+'}${Math.floor(size / 60)}` +
      (size % 60 ? ':' + two(size % 60) : '');
}

export function dateText(ms) {
  const [y, m, d] = parts(ms);
  return `${y}-${two(m)}-${two(d)}`;
}

export function clockText(ms) {
  const [, , , h, m, s] = parts(ms);
  return `${two(h)}:${two(m)}:${two(s)}`;
}

/** With the date only where it is not today. */
export function timeText(ms) {
  if (ms === null || ms === undefined) return '–';
  return dateText(ms) === dateText(Date.now()) ?
    clockText(ms) : `${dateText(ms)} ${clockText(ms)}`;
}

/** Where there is room for one of both: the time of today, or the date. */
export const shortTimeText = (ms) =>
  dateText(ms) === dateText(Date.now()) ? clockText(ms) : dateText(ms);

/** "42 s", "3 min 05 s", "2 h 10 min", "3 d 4 h" */
export function durationText(ms) {
  if (ms === null || ms === undefined) return '–';
  const s = Math.max(0, Math.round(ms / 1000));
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${two(s % 60)} s`;
  if (s < 86400) {
    return `${Math.floor(s / 3600)} h ${two(Math.floor(s % 3600 / 60))} min`;
  }
  return `${Math.floor(s / 86400)} d ${Math.floor(s % 86400 / 3600)} h`;
}

/** As many digits as a reader needs. */
export function numberText(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) {
    return '–';
  }
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) {
    return value.toExponential(digits - 1);
  }
  const decimals = size === 0 ? 0 :
    Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return value.toFixed(Math.min(decimals, digits)).replace('-', '−');
}

export function unitText(unit) {
  return (unit ?? '').replace('m3', 'm³').replace('degC', '°C')
      .replace('_', ' ').replace('m³ per h', 'm³/h');
}

export function factorText(value) {
  return value === null || value === undefined || !Number.isFinite(value) ?
    '–' : value.toFixed(2);
}

/** "12 %", and "0 %": the end of an interval. */
export const wholePercent = (v) => `${Math.round(100 * v)} %`
    .replace('-', '−');

/** "12 %" of what the model set was trained to; a dash where it is none. */
export function percentText(value) {
  return value === null || value === undefined || !Number.isFinite(value) ||
    Math.abs(value) < 0.005 ? '–' : wholePercent(value);
}

/** How strong a fault is, in words; empty where it is none. */
export function strengthText(value) {
  if (percentText(value) === '–') return '';
  const percent = Math.round(100 * Math.abs(value));
  return percent < 20 ? 'slight' : percent < 50 ? 'moderate' :
    percent < 80 ? 'strong' : 'severe';
}

/** "12 % (10 % to 14 %)"; an interval without width is not known. */
export function intervalText({value, lowest, highest}, text, unit = '',
    end = text) {
  const range = rangeText(lowest, highest, end);
  return text(value) + unit + (range && ` (${range})`);
}

/** "17 % to 20 %"; empty without a width that can be seen. */
export function rangeText(lowest, highest, end) {
  const known = lowest !== null && lowest !== undefined && lowest < highest;
  const [from, to] = known ? [end(lowest), end(highest)] : ['', ''];
  return from === to ? '' : `${from} to ${to}`;
}

/** Names with digits in the order a reader expects: FV-2 before FV-10. */
const collator = new Intl.Collator('en', {numeric: true});
export const compareNames = (a, b) => collator.compare(a, b);

/** What an id has in common with its neighbours: "U1-FV" of "U1-FV-102B". */
export const groupOfId = (id) =>
  id.replace(/[-_./ ]*\d+[^-_./ \d]*$/, '') || id;

/** Whether a text matches a pattern with * ? [...]. */
export function globTest(pattern) {
  const test = new RegExp('^' + pattern.replace(/[.+^${}()|\\]/g, '\\$&')
      .replaceAll('*', '.*').replaceAll('?', '.') + '$', 's');
  return (text) => test.test(text);
}

/** A datetime-local value and back, in the zone that was chosen. */
export function toInput(ms) {
  return ms === null || ms === undefined || Number.isNaN(ms) ? '' :
    `${dateText(ms)}T${clockText(ms).slice(0, 5)}`;
}

export function fromInput(text) {
  if (!text) return null;
  return Date.parse(settings.get('utc') ? text + 'Z' : text);
}
