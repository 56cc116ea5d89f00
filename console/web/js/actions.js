// Actions of an operator on alarms: acknowledge, shelve, label. Each is a
// dialog that asks why; who it was is known from the proxy.

import {path, post} from './api.js';
import {button, field, h, replace, select, showDialog} from './dom.js';
import {faultTitle, members, moreText, rowTitle} from './faults.js';
import {fromInput} from './format.js';
import {store} from './store.js';

/** Whether the monitor takes actions at all. */
export const canAct = () => store.status?.write === true;
const canLabel = () => store.status.role === 'engineer';

/**
 * A dialog with a comment, which `send` gets; it may throw.
 * @returns a promise of whether it was sent.
 */
function ask({title, subject, fields, verb, commentNeeded, send}) {
  const comment = h('textarea', {rows: 2, maxlength: 1000,
    required: commentNeeded});
  const wrong = h('p', {class: 'wrong', role: 'alert', hidden: true});
  const submit = h('button', {class: 'primary'}, verb);
  const form = h('form', {method: 'dialog'}, h('p', {}, subject), fields,
      field(commentNeeded ? 'Reason' : 'Comment', comment), wrong,
      h('div', {class: 'buttons'},
          button('Cancel', () => dialog.close()), submit));
  const dialog = h('dialog', {}, h('h2', {}, title), form);
  return new Promise((resolve) => {
    let sent = false;
    form.addEventListener('submit', async (event) => {
      event.preventDefault();
      submit.disabled = true;
      try {
        await send({comment: comment.value});
        sent = true;
        dialog.close();
      } catch (error) {
        wrong.hidden = false;
        replace(wrong, error.message);
        submit.disabled = false;
      }
    });
    dialog.addEventListener('close', () => resolve(sent));
    showDialog(dialog);
    comment.focus();
  });
}

function describe(rows) {
  return rows.length === 1 ?
    `${rows[0].valve}: ${rowTitle(rows[0])}${moreText(rows[0])}` :
    `${rows.length} alarms`;
}

export function acknowledge(rows) {
  const done = new Set();  // Rows that an attempt finished before it failed.
  return ask({
    title: 'Acknowledge', verb: 'Acknowledge', subject: describe(rows),
    fields: [],
    send: async (body) => {
      for (const {episode} of rows) {
        if (done.has(episode)) continue;
        store.applyAlarm(await post(path('episodes', episode, 'ack'), body));
        done.add(episode);
      }
    },
  });
}

const kShelfTimes = [
  [30, '30 minutes'], [60, '1 hour'], [240, '4 hours'], [480, '8 hours'],
  [1440, '1 day'], [10080, '7 days'],
];

export function shelve(row) {
  const minutes = select(kShelfTimes, '480');
  const from = h('input', {type: 'datetime-local'});
  const own = row.fault && row.fault !== 'unknown' ? row.fault : null;
  const scope = select([
    ...(own ? [[own, `Only ${faultTitle(own)}`]] : []),
    ['', 'Every alarm of this valve'],
  ], own ?? '');
  return ask({
    title: 'Shelve', verb: 'Shelve', subject: row.valve, commentNeeded: true,
    fields: [field('From (empty: now)', from), field('For', minutes),
      field('What', scope)],
    send: (body) => post('/shelf', {
      valve: row.valve, fault: scope.value || null,
      minutes: Number(minutes.value), from_ms: fromInput(from.value), ...body,
    }),
  });
}

export function unshelve(row) {
  return ask({
    title: 'Take off the shelf', verb: 'Unshelve', subject: describe([row]),
    fields: [], send: (body) =>
      post(path('shelf', row.shelved.shelf_id, 'end'), body),
  });
}

export function label(row) {
  if (!canLabel()) return false;
  const own = members(row.fault);
  const choice = select([
    ['true', own.length > 0 ? 'As the alarm says' : 'A fault of some kind'],
    ['false', 'Nothing: a false alarm'],
    ...[...store.faults.values()].filter((fault) => fault.label)
        .map(({fault}) => [fault, faultTitle(fault)]),
  ], row.label ?? 'true');
  return ask({
    title: 'Label', verb: 'Label', subject: describe([row]),
    fields: [field('What was it?', choice)],
    send: async (body) => store.applyAlarm(await post(
        path('episodes', row.episode, 'label'),
        {label: choice.value, ...body})),
  });
}

/** Buttons for what can be done to an alarm now; `done` after each. */
export function actionButtons(row, done) {
  if (!canAct()) return [];
  const acting = (text, action, target) =>
    button(text, async () => await action(target) && done?.(),
        {'aria-label': `${text} ${row.valve}`});
  const open = row.isa === 'UNACK' || row.isa === 'RTN_UNACK';
  const over = ['RTN_UNACK', 'NORMAL', 'NOTICE'].includes(row.isa);
  return [
    open ? acting('Acknowledge', acknowledge, [row]) : null,
    row.shelved ? acting('Unshelve', unshelve, row) :
      over ? null :
        acting('Shelve', shelve, row),
    canLabel() ? acting('Label', label, row) : null,
  ];
}
