// Faults in the words of the catalogue, and how alarms are ranked.

import {h, svg} from './dom.js';
import {factorText, timeText, unitText} from './format.js';
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
  if (fault === 'unknown') return 'unlike any known fault';
  if (!fault) return 'fault, not yet known which';
  return members(fault).map(nameOf).join(' or ');
}

const titleOf = (fault) =>
  nameOf(fault) === fault ? fault : `${nameOf(fault)} (${fault})`;

/** "flow sensor (f19) or erosion (f3)" */
export function faultTitle(fault) {
  return members(fault).map(titleOf).join(' or ') || faultName(fault);
}

/** The same as nodes, the codes in small letters. */
export function faultNodes(fault) {
  return members(fault).map((each, i) => [i > 0 ? ' or ' : '', nameOf(each),
    nameOf(each) === each ? null :
      h('span', {class: 'number'}, ` ${each}`)]);
}

/** Of an alarm; one that ended before it had a name is like no other. */
export const rowTitle = ({fault, certainty, name}, title = faultTitle) =>
  fault === 'unknown' && certainty === 'not yet' ? name : title(fault);

/** "likely", "one of 3"; empty for what needs no word. */
export function certaintyText({certainty, faults, fault, look_alikes}) {
  return certainty !== 'one of' ? certainty ?? '' : `one of ${
    members(faults?.join('|') || fault).length + (look_alikes ?? []).length}`;
}

/**
 * " or Bypass open (f18), and Valve clogging (f1)": what looks the same to a
 * model set, and what came on top; or empty.
 */
export const moreText = ({look_alikes: others, second}, title = faultTitle) =>
  (others ?? []).map((fault) => ` or ${title(fault)}`).join('') +
  (!second ? '' : `, and ${second === 'unknown' ?
    'a second fault without a name' : title(second)}`);

/** The same as an element that tells what is behind it. */
export function certaintyNode(row, name = 'tag') {
  const text = certaintyText(row);
  const factor = row.factor ?? row.peak_factor;
  return text === '' ? null : h('span', {class: name,
    title: row.witness || (factor === null ? null : factorTitle(factor))}, text);
}

export const factorTitle = (d) => `decision factor ${factorText(d)}`;

const kPriority = {critical: 1, high: 2, medium: 3, low: 4};

/** 1 (critical) to 4 (low), as the monitor says. */
export const priorityOf = (row) => kPriority[row.severity] ?? kPriority.medium;

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
  return key === 'NOTICE' ? 'Notice' :
    groups.find((group) => group.key === key)?.name ?? 'Normal';
}

/** In the order of the work list, which has nothing that is shelved. */
export function compareAlarms(a, b) {
  const place = (row) => row.shelved ? 2 : row.returned_ms === null ? 0 : 1;
  const key = (row) => `${row.valve}\n${row.episode}`;
  return place(a) - place(b) || b.score - a.score ||
      b.detected_ms - a.detected_ms || (key(a) < key(b) ? -1 : 1);
}

/** Of an alarm whose data ended; empty otherwise. */
export const unconfirmedText = ({unconfirmed_ms: since}) =>
  since ? `not confirmed since ${timeText(since)}` : '';

/** Of the alarm of a valve that is not judged now. */
export const openText = (tile) => `${faultTitle(tile.fault)}: ` +
    (unconfirmedText(tile) || 'not judged now');

/** NE 107 class in words. */
export const namurText = (name) => name ? plain(name) : '–';

/** Whether a fault is detected; a valve that is not judged is in none. */
export const inAlarm = ({state}) =>
  state === 'DETECTED' || state === 'ISOLATED';

/** Whether a fault is there as far as anybody knows, judged now or not. */
export const isAlarm = (tile) => inAlarm(tile) || Boolean(tile.active);

/** What a tile is named after: "f19|f3", "unknown", or empty. */
export const faultOfTile = (tile) => !inAlarm(tile) ? tile.fault :
  tile.certainty === 'not known' ? 'unknown' : tile.faults.join('|');

const kStateWords = {
  NORMAL: 'normal', NOT_JUDGED: 'not judged',
  PARTLY_JUDGED: 'partly judged', DETECTED: 'fault detected',
  ISOLATED: 'fault named', REISOLATED: 'renamed', CLEARED: 'returned',
  CLOSED: 'ended',
};
export const stateWord = (state) => kStateWords[state] ?? state;

const plain = (word) => String(word).toLowerCase().replaceAll('_', ' ');

const kQualityWords = {
  LIVE: 'live', STALE: 'no data', BAD_INPUT: 'bad input',
  SETTLING: 'settling', INHIBITED: 'inhibited', UNCOVERED: 'untrained region',
  MODEL_UNSUITED: 'model unsuited', UNASSIGNED: 'no model set',
  ENDED: 'stream ended', MONITOR_SILENT: 'monitor silent',
};
const kReasonWords = {
  mode: 'mode is not AUTO', cv: 'command beyond what was trained',
  cv_step: 'command stepped as never in training',
  parked: 'parked at an end of travel', dp: 'pressure drop outside normal',
  t1: 'T1 outside normal', p1: 'P1 outside normal', p2: 'P2 outside normal',
  waiting: 'back inside, but not for long enough yet',
  no_readings: 'no new readings',
};
const kRefusalWords = {
  bad_quality: 'marked bad at the source', not_finite: 'no number',
  range: 'implausible: in another unit?',
};

function refusalText({reason, signals, flow_unit: unit}) {
  if (reason === 'unit') {
    if (!signals.length) return 'a reading in another unit than trained';
    return signals.some((signal) => signal !== 'F') ?
      `${signals.join(' or ')} in another unit than trained` :
      `flow in another unit than ${unitText(unit)}`;
  }
  if (reason === 'period') return 'samples at another interval than trained';
  return kRefusalWords[reason] ?
    `${signals.join(', ')} ${kRefusalWords[reason]}` : '';
}

// "no P1; F not judged"
function lackText(
    {quality, missing, unjudged, refused, blind, contested, notice}) {
  return [
    notice ? 'a notice, within the budget of alarms' : '',
    contested ? 'two publishers send it, the newest counts' : '',
    blind ? 'limits too wide to see a fault' : '',
    missing?.length ? `no ${missing.join(', ')}` : '',
    unjudged?.length ? `${unjudged.join(', ')} not judged` : '',
    refused && quality !== 'LIVE' ? refusalText(refused) : '',
  ].filter(Boolean).join('; ');
}

/** Why a valve is not judged, or only in part; empty if it is. */
export function qualityText(tile) {
  const {quality, stamp_ms: stamp, reasons, monitor,
    monitor_silent_since_ms: silent, unjudged_since_ms: since} = tile;
  if (quality === 'LIVE') return lackText(tile);
  if (silent) return `monitor ${monitor} silent since ${timeText(silent)}`;
  const lack =
    quality === 'BAD_INPUT' || tile.contested ? lackText(tile) : '';
  const why = lack || (reasons || (tile.why ?? '').split(' ')[1] || '')
    .split('|').map((r) => kReasonWords[r] ?? r).join(', ');
  return (kQualityWords[quality] ?? plain(quality)) +
      (stamp && quality === 'STALE' ? ` since ${timeText(stamp)}` :
        stamp && quality === 'ENDED' ? ` at ${timeText(stamp)}` :
          since ? `, not judged since ${timeText(since)}` : '') +
      (why ? `: ${why}` : '');
}

/** Why nothing is known of a valve at this moment; empty if it is judged. */
export function notJudgedText(tile) {
  if (!tile || tile.quality === 'LIVE') return '';
  return ['STALE', 'ENDED', 'MONITOR_SILENT'].includes(tile.quality) ?
    `not confirmed since ${timeText(tile.stamp_ms)}` :
    `${tile.unjudged_since_ms ? '' : 'not judged: '}${qualityText(tile)}`;
}

const kMarkWords = {
  ISOLATED: 'named', REISOLATED: 'renamed', CHANGED: 'priority rose',
  RAISED: 'became an alarm', SECOND: 'second fault', ACK: 'acknowledged',
  LABEL: 'labelled', CLOSED: 'episode ended',  // "Closed" is said of a valve.
};
/** `text` of a mark, or faults of an event: none if a name was withdrawn. */
export const markWord = (kind, text) => kind === 'REISOLATED' && !text ?
  'name withdrawn' : kMarkWords[String(kind).toUpperCase()] ?? plain(kind);

/** What gave a fault its name, where that is not the observers. */
export const layerText = (layer) =>
  layer === 'physics' ? 'named by simulation of the valve' :
    layer === 'audit' ? 'named by the audit of the loop' : '';

// Signs of alarms: shape, number and text say what the colour says.
const kShapes = {
  1: 'M2 2h16v16H2z',
  2: 'M10 1l9.5 17H.5z',
  3: 'M.5 2h19L10 19z',
  4: 'M10 1a9 9 0 1 0 0 18a9 9 0 1 0 0-18z',
};
const kTextY = {1: 14, 2: 16, 3: 11.5, 4: 14};

/** Square, triangle, triangle on its tip, circle; hollow until isolated. */
export function prioritySign(priority, isolated = true) {
  return svg('svg', {
    'class': `sign p${priority}${isolated ? '' : ' hollow'}`,
    'viewBox': '0 0 20 20', 'aria-hidden': 'true', 'focusable': 'false',
  },
  svg('path', {d: kShapes[priority]}),
  svg('text', {x: 10, y: kTextY[priority], 'text-anchor': 'middle'},
      isolated ? String(priority) : '?'));
}
