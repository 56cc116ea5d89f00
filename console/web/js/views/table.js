// Tables by declaration of their columns: {text, cell(row), class, header,
// said}; `said` where a card needs the title of the column, too.

import {h} from '../dom.js';
import {certaintyNode, faultNodes, faultTitle, groupName, members, moreText,
  namurText, priorityNames, priorityOf, prioritySign, qualityText, rowTitle,
  unconfirmedText} from '../faults.js';
import {durationText, percentText, strengthText, timeText} from '../format.js';
import {link} from '../route.js';
import {store} from '../store.js';

export function headRow(list) {
  return h('tr', {role: 'row'}, list.map(({text, class: name}) =>
    h('th', {scope: 'col', role: 'columnheader', class: name}, text)));
}

export function bodyRow(list, row, attributes = {}) {
  return h('tr', {role: 'row', ...attributes}, list.map(
      ({header, cell, said, text, class: name}) => h(header ? 'th' : 'td', {
        'class': name, 'scope': header ? 'row' : null,
        'data-said': said ? text : null,
        'role': header ? 'rowheader' : 'cell'}, cell(row))));
}

/**
 * A table in a box that scrolls by itself where it is wider than the window.
 * `layout`: 'small', or 'cards' for rows that become cards where there is no
 * room for columns. `attributesOf(row)` are those of its line.
 */
export function dataTable(caption, list, rows,
    {layout = 'small', attributesOf = () => ({}), head, body} = {}) {
  const hidden = layout !== 'small';
  return h('div', {'class': 'table-box', 'role': 'region',
    'aria-label': caption, 'tabindex': 0},
  h('table', {class: layout, role: 'table'},
      h('caption', {class: hidden ? 'sr-only' : null}, caption),
      head ?? h('thead', {role: 'rowgroup'}, headRow(list)),
      body ?? h('tbody', {role: 'rowgroup'}, rows.map((row) =>
        bodyRow(list, row, attributesOf(row))))));
}

/** A cell of time that machines can read, too. */
export function timeCell(ms) {
  return ms === null || ms === undefined ? '–' :
    h('time', {datetime: new Date(ms).toISOString()}, timeText(ms));
}

function priorityCell(row) {
  const priority = priorityOf(row);
  return h('span', {class: 'with-sign'},
      prioritySign(priority, members(row.fault).length > 0),
      h('span', {class: 'sr-only'}, priorityNames[priority]));
}

function faultCell(row) {
  const named = members(row.fault).length > 0;
  return h('a', {href: link('episode', row.episode), title:
    rowTitle(row) + moreText(row)},
  named ? faultNodes(row.fault) : rowTitle(row),
  (row.look_alikes ?? []).map((fault) => [' or ', faultNodes(fault)]),
  moreText({second: row.second}));
}

/** A fault, what somebody found it to be, and what to check. */
export const faultAndCheck = {text: 'Fault', class: 'fault', cell: (row) => [
  faultCell(row),
  row.label && h('div', {}, `label: ${labelText(row.label)}`),
  row.check ? h('div', {class: 'to-check', title: row.check},
      row.check) : null]};

/** "mechanical or instrument" */
export const forText = (discipline) =>
  discipline?.split('|').join(' or ') ?? '–';

/** How long it stood, or stands; the end of its data is no end of it. */
export function lastedText(row) {
  return durationText(
      (row.returned_ms ?? store.valveNowMs(row.valve)) - row.detected_ms);
}

export function labelText(label) {
  if (!label) return '–';
  if (label === 'true') return 'right';
  return label === 'false' ? 'false alarm' : `was ${faultTitle(label)}`;
}

// Since when nothing says that it lasts, and who has acknowledged or shelved it.
function personText(row) {
  if (row.shelved) {
    const {until_ms: until, who, comment} = row.shelved;
    return `until ${timeText(until)} by ${who}` +
        (comment ? `: ${comment}` : '');
  }
  const tile = store.tiles.get(row.valve);
  const silent = tile?.episode === row.episode && tile.quality !== 'LIVE';
  return [unconfirmedText(row) || (silent && qualityText(tile)),
    row.acked_by && `${row.acked_by}, ${timeText(row.acked_ms)}`]
      .filter(Boolean).join('; ');
}

export const valveLink = (valve) => h('a', {href: link('valve', valve)}, valve);

/** A valve, who it is and, of a plant, the monitor that `row` is from. */
export const valveCell = (valve, {host, monitor, about}) => [valveLink(valve),
  about?.description && h('div', {class: 'remark'}, about.description),
  about?.location && h('div', {class: 'number'}, about.location),
  monitor && h('div', {class: 'number'}, `${host}/${monitor}`)];

/** A data sheet: a link where it is an address of the web. */
export const documentNode = (document) => !document ? null :
  /^https?:\/\//.test(document) ? h('a', {href: document, target: '_blank',
    rel: 'noopener noreferrer'}, 'data sheet') : `data sheet ${document}`;

/** "Feed to column C-101, hall 2, data sheet"; empty if nothing is stated. */
export const aboutNodes = (about) => [about?.description, about?.location,
  documentNode(about?.document)].filter(Boolean)
    .flatMap((part, i) => i > 0 ? [', ', part] : [part]);

/** The columns of alarms. */
export const columns = {
  priority: {text: 'Priority', cell: priorityCell},
  detected: {text: 'Detected', cell: (row) => timeCell(row.detected_ms)},
  valve: {text: 'Valve', header: true, cell: (row) =>
    valveCell(row.valve, row)},
  fault: {text: 'Fault', class: 'fault', cell: faultCell},
  group: {text: 'State', class: 'remark', cell: (row) => [
    groupName(row), h('div', {class: 'number'}, personText(row))]},
  lasted: {text: 'Lasted', class: 'num', said: true, cell: lastedText},
  certainty: {text: 'How sure', cell: (row) =>
    certaintyNode(row, '')},
  strength: {text: 'Strength', cell: (row) =>
    h('span', {title: percentText(row.strength)}, strengthText(row.strength))},
  discipline: {text: 'For', class: 'wider', cell: ({discipline}) =>
    forText(discipline)},
  namur: {text: 'NE 107', class: 'wider', cell: (row) => namurText(row.namur)},
  label: {text: 'Label', class: 'wide', cell: (row) => labelText(row.label)},
};
