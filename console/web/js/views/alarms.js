// The alarms in the order of the work list, the shelved ones last. Each says in
// which state of ISA-18.2 it is; a chip selects those of one state.

import {acknowledge, actionButtons, canAct, label, shelve}
  from '../actions.js';
import {button, h, replace, setText} from '../dom.js';
import {get} from '../api.js';
import {compareAlarms, faultTitle, groupOf, groups} from '../faults.js';
import {timeText} from '../format.js';
import {link, rememberQuery} from '../route.js';
import {store} from '../store.js';
import {bodyRow, columns, dataTable, faultAndCheck, headRow} from './table.js';
import {oncePerFrame, View} from './view.js';

const kColumns = [
  columns.priority, columns.detected, columns.valve, faultAndCheck,
  columns.group, columns.lasted, columns.certainty, columns.strength,
  columns.discipline, columns.namur,
];

function causeLine({group, opened_ms: since, members}) {
  return h('p', {class: 'cause'}, h('strong', {}, `Common cause in ${group}`),
      `, since ${timeText(since)}: ${members.length} valves, `,
      members.map(({valve, fault, episode}, i) => [i > 0 ? ', ' : '', h('a',
          {href: link('episode', episode), title: faultTitle(fault)}, valve)]));
}

const kCausesPeriodMs = 5000;

class Alarms extends View {
  title = 'Alarms';
  #selected = new Set();
  #current = null;  // Episode that the keys act upon.
  #group;
  #body = h('tbody', {role: 'rowgroup'});
  #head = h('thead', {role: 'rowgroup'});
  #chips = new Map();
  #causes = h('div', {role: 'status'});
  #shownCauses = '[]';  // Only changed rows are read out again.
  #asOf = h('p', {class: 'number'});
  #nothing = h('p', {class: 'nothing', hidden: true});
  #table = dataTable('Alarms, worst first', kColumns, [],
      {layout: 'cards', head: this.#head, body: this.#body});
  #bulk = button('', () => this.#acknowledgeSelected(),
      {class: 'primary', hidden: true});
  #readOnly = h('p', {class: 'note', hidden: true});

  constructor({query}) {
    super();
    this.#group = query.get('group') ?? '';
    this.element = h('section', {class: 'live'},
        h('div', {class: 'controls'}, h('h1', {}, 'Alarms'), this.#makeChips(),
            this.#bulk), this.#asOf, this.#readOnly, this.#causes, this.#nothing,
        this.#table);
    // A flood of alarms costs one table a frame.
    const showSoon = oncePerFrame(this, () => this.#show());
    this.on(store, 'alarms', showSoon);
    this.on(store, 'status', showSoon);
    this.every(1000, () => this.#showLasted());
    this.every(kCausesPeriodMs, () => this.#fetchCauses());
    this.#fetchCauses();
    this.key('j', 'Next alarm', () => this.#move(1));
    this.key('k', 'Alarm before', () => this.#move(-1));
    this.key('a', 'Acknowledge the alarm', () => this.#act((row) =>
      row.isa !== 'ACKED' && acknowledge([row])));
    this.key('s', 'Shelve the alarm', () => this.#act((row) =>
      !row.shelved && shelve(row)));
    this.key('l', 'Label the alarm', () => this.#act(label));
    this.key('x', 'Select the alarm', () => this.#toggle(this.#current));
    this.#show();
  }

  async #fetchCauses() {
    try {
      const {causes} = await get('/causes');
      const key = JSON.stringify(causes);
      if (this.gone || key === this.#shownCauses) return;
      this.#shownCauses = key;
      replace(this.#causes, causes.map(causeLine));
    } catch {
      // Asked again soon.
    }
  }

  #makeChips() {
    const all = [{key: '', name: 'All', text: 'every group'}, ...groups];
    return h('div', {'class': 'chips', 'role': 'group', 'aria-label': 'Group'},
        all.map(({key, name, text}) => {
          const count = h('span', {class: 'chip-count'});
          const chip = button([name, ' ', count], () => {
            this.#group = key;
            rememberQuery('alarms', '', {group: key});
            this.#show();
          }, {class: 'chip', title: text});
          this.#chips.set(key, {chip, count});
          return chip;
        }));
  }

  #rows() {
    return [...store.alarms.values()].sort(compareAlarms)
        .filter((row) => !this.#group || groupOf(row) === this.#group);
  }

  #show() {
    const rows = this.#rows();
    const focused = this.#focusedPlace();
    for (const episode of this.#selected) {
      if (!store.alarms.has(episode)) this.#selected.delete(episode);
    }
    this.#readOnly.hidden = !store.status || canAct();
    setText(this.#readOnly, store.status?.plant ? 'Read-only: acknowledge, ' +
      'shelve and label on the page of the monitor, or with fdi-store.' :
      store.status?.user ? 'Read-only: your role is view.' :
      'Read-only: to act, open the page through nginx.');
    replace(this.#head, headRow([
      ...(canAct() ? [{class: 'for-hand',
        text: h('span', {class: 'sr-only'}, 'Selected')}] : []),
      ...kColumns, ...(canAct() ? [{text: 'Actions', class: 'for-hand'}] : [])]));
    replace(this.#body, rows.map((row) => this.#row(row)));
    this.#showCounts(rows);
    this.#showLasted();
    this.#restoreFocus(focused);
  }

  #row(row) {
    const box = h('input', {'type': 'checkbox',
      'checked': this.#selected.has(row.episode),
      'aria-label': `Select ${row.valve}`,
      'onchange': () => this.#toggle(row.episode)});
    const acting = canAct();
    return bodyRow([
      ...(acting ? [{class: 'for-hand', cell: () => box}] : []), ...kColumns,
      ...(acting ? [{class: 'for-hand', cell: () =>
        h('div', {class: 'row-actions'}, actionButtons(row))}] : []),
    ], row, {
      'class': `group-${groupOf(row)}` +
        (row.episode === this.#current ? ' current' : ''),
      'data-episode': row.episode,
    });
  }

  #showCounts(rows) {
    const all = [...store.alarms.values()];
    for (const [key, {chip, count}] of this.#chips) {
      setText(count, String(all.filter((row) =>
        !key || groupOf(row) === key).length));
      chip.setAttribute('aria-pressed', String(this.#group === key));
    }
    this.#nothing.hidden = rows.length > 0;
    this.#table.hidden = rows.length === 0;
    setText(this.#nothing, all.length === 0 ?
      'No alarm is open or waiting to be acknowledged.' : 'No alarm in this group.');
    this.#bulk.hidden = this.#selected.size === 0;
    setText(this.#bulk, `Acknowledge ${this.#selected.size} selected`);
  }

  // Only the times run on; the rows stay as they are.
  #showLasted() {
    const {connected, heardMs} = store.stream;
    const asOf = connected ? store.nowMs() : heardMs;
    setText(this.#asOf, asOf ? `As of ${timeText(asOf)}` : '');
    for (const node of this.#body.rows) {
      const row = store.alarms.get(node.dataset.episode);
      if (!row || row.returned_ms !== null) continue;
      const at = kColumns.indexOf(columns.lasted) + (canAct() ? 1 : 0);
      setText(node.cells[at], columns.lasted.cell(row));
    }
  }

  #toggle(episode) {
    if (!episode || !canAct()) return;
    if (!this.#selected.delete(episode)) this.#selected.add(episode);
    this.#show();
  }

  #acknowledgeSelected() {
    const rows = this.#rows().filter((row) =>
      this.#selected.has(row.episode) && row.isa !== 'ACKED');
    if (rows.length > 0) {
      acknowledge(rows).then((sent) => sent && this.#selected.clear());
    }
  }

  #move(step) {
    const rows = this.#rows();
    const at = rows.findIndex((row) => row.episode === this.#current);
    const next = rows[Math.min(rows.length - 1, Math.max(0, at + step))];
    if (!next) return;
    this.#current = next.episode;
    this.#show();
    const node = this.#nodeOf(next.episode);
    node?.scrollIntoView({block: 'nearest'});
    node?.querySelector(`a[href="${link('episode', next.episode)}"]`)?.focus();
  }

  #act(action) {
    const row = store.alarms.get(this.#current);
    if (row && canAct()) action(row);
  }

  #nodeOf(episode) {
    return [...this.#body.rows].find((r) => r.dataset.episode === episode);
  }

  // The list is made anew; who works by keys stays where he was.
  #focusedPlace() {
    const node = document.activeElement?.closest?.('tr[data-episode]');
    if (!node || !this.#body.contains(node)) return null;
    const controls = [...node.querySelectorAll('a, button, input')];
    return {episode: node.dataset.episode,
      index: controls.indexOf(document.activeElement)};
  }

  #restoreFocus(place) {
    if (!place) return;
    const node = this.#nodeOf(place.episode);
    node?.querySelectorAll('a, button, input')[place.index]
        ?.focus({preventScroll: true});
  }
}

export const alarmsView = (route) => new Alarms(route);
