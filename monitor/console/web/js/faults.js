// Faults in the words of the catalogue, and how alarms are ranked.

import {store} from './store.js';

/** Members of "f19|f3". */
export function members(fault) {
  return fault && fault !== 'unknown' ? fault.split('|') : [];
}

function nameOf(fault) {
  return store.faults.get(fault)?.name ?? fault;
}

/** "flow sensor or erosion"; in words, too, where nothing is isolated. */
export function faultName(fault) {
  if (fault === 'unknown') return 'unknown: no model fits';
  if (!fault) return 'not isolated yet';
  return members(fault).map(nameOf).join(' or ');
}

/** "flow sensor (f19)" */
export function faultTitle(fault) {
  const name = faultName(fault);
  return members(fault).length > 0 && name !== fault ?
    `${name} (${fault})` : name;
}

const kPriority = {critical: 1, high: 2, medium: 3, low: 4};

/** Level of the catalogue's bands at a strength (0..1). */
function levelAt(bands, strength) {
  const size = Math.abs(strength ?? 0);
  return bands.filter((band) => band.from <= size).at(-1)?.level;
}

/** 1 (critical) to 4 (low); what is not isolated yet counts as medium. */
export function priorityOf(row) {
  const fault = row.fault ?? row.faults?.join('|');
  const severity = row.severity ??
      store.faults.get(members(fault)[0])?.severity;
  const level = Array.isArray(severity) ?
    levelAt(severity, row.strength) : severity;
  return kPriority[level] ?? 3;
}

export const priorityNames =
    ['', 'critical', 'high priority', 'medium priority', 'low priority'];

/** The group of ISA-18.2 an alarm stands in. */
export function groupOf(row) {
  return row.shelved ? 'SHELVED' : row.isa;
}

export const groups = [
  {key: 'UNACK', name: 'Unacknowledged', text: 'active, nobody has seen it'},
  {key: 'RTN_UNACK', name: 'Returned', text: 'gone again, unacknowledged'},
  {key: 'ACKED', name: 'Acknowledged', text: 'active, seen'},
  {key: 'SHELVED', name: 'Shelved', text: 'put aside for a time'},
];

export function groupName(row) {
  const key = groupOf(row);
  return groups.find((group) => group.key === key)?.name ?? 'Normal';
}

/** Worst first: by group, priority, then the newest. */
export function compareAlarms(a, b) {
  const group = (row) => groups.findIndex((g) => g.key === groupOf(row));
  return group(a) - group(b) || priorityOf(a) - priorityOf(b) ||
      b.detected_ms - a.detected_ms || (a.episode < b.episode ? -1 : 1);
}

const namur = {
  F: 'failure', C: 'check function', S: 'out of specification',
  M: 'maintenance required',
};

/** NE 107 class in words. */
export function namurText(code) {
  return code ? namur[code] ?? String(code).replaceAll('_', ' ') : '–';
}

const kStateWords = {
  NORMAL: 'normal', DETECTED: 'fault detected', ISOLATED: 'fault isolated',
  REISOLATED: 'isolated anew', CLEARED: 'cleared', CLOSED: 'closed',
};
export const stateWord = (state) => kStateWords[state] ?? state;

const kQualityWords = {
  LIVE: 'live', STALE: 'no data', BAD_INPUT: 'bad input',
  SETTLING: 'settling', INHIBITED: 'inhibited', UNCOVERED: 'untrained region',
  MODEL_UNSUITED: 'model unsuited', UNASSIGNED: 'no model set',
  ENDED: 'stream ended',
};
export const qualityWord = (quality) =>
  kQualityWords[quality] ?? String(quality).toLowerCase().replaceAll('_', ' ');

const kMarkWords = {
  REISOLATED: 'isolated anew', ACK: 'acknowledged', LABEL: 'labelled',
};
export const markWord = (kind) =>
  kMarkWords[String(kind).toUpperCase()] ??
    String(kind).toLowerCase().replaceAll('_', ' ');
