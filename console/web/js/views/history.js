// Questions to the history: by valve, fault, time and state; the figures of
// the alarms of that time. The question is in the address: it can be sent.

import {get} from '../api.js';
import {csvOf} from '../csv.js';
import {button, download, errorNote, field, h, replace, select, setText}
  from '../dom.js';
import {faultTitle} from '../faults.js';
import {fromInput, toInput, zoneName} from '../format.js';
import {link} from '../route.js';
import {store} from '../store.js';
import {statisticsSection} from './statistics.js';
import {bodyRow, columns, dataTable} from './table.js';
import {View} from './view.js';

const kPage = 100;
const kDayMs = 86400000;
const kDefaultDays = 30;
const kStates = [
  ['', 'any'], ['open', 'open'], ['detected', 'detected, not named'],
  ['isolated', 'named'], ['closed', 'ended'], ['unack', 'unacknowledged'],
  ['rtn_unack', 'returned'], ['acked', 'acknowledged'],
  ['shelved', 'shelved'],
];
const kColumns = [
  columns.priority, columns.detected, columns.valve, columns.fault,
  columns.group, columns.lasted, columns.certainty, columns.strength,
  columns.label,
];

const kSaved = ['episode', 'valve', 'fault', 'name', 'state', 'isa',
  'certainty', 'detected_ms', 'isolated_ms', 'cleared_ms', 'ended_ms',
  'end_reason', 'peak_factor', 'strength', 'label', 'acked_by', 'model_set'];

class History extends View {
  title = 'History';
  #rows = [];
  #asked = 0;  // Only the last question is answered.
  #inputs;
  #body = h('tbody', {role: 'rowgroup'});
  #table = dataTable('Episodes, newest first', kColumns, [],
      {layout: 'cards', body: this.#body});
  #found = h('p', {class: 'note', role: 'status'});
  #more = button('Older ones', () => this.#fetchRows(true), {hidden: true});
  #statistics = h('div', {});

  constructor({query}) {
    super();
    this.#makeInputs(query);
    this.element = h('section', {class: 'history', 'aria-label': 'History'},
        h('div', {class: 'controls'}, h('h1', {}, 'History')), this.#form(),
        this.#statistics,
        h('div', {class: 'controls'}, h('h2', {}, 'Episodes'), this.#found,
            button('Save as CSV', () => download('episodes.csv',
                new Blob([csvOf(kSaved, this.#rows)], {type: 'text/csv'})))),
        this.#table, this.#more);
    this.on(store, 'tiles', (ids) => {
      if (ids === null) this.#fillFaults(query.get('fault') ?? '');
    });
    this.#fetch();
  }

  #makeInputs(query) {
    const time = (name) => h('input', {type: 'datetime-local',
      value: toInput(query.has(name) ? Number(query.get(name)) : null)});
    this.#inputs = {
      valve: h('input', {value: query.get('valve') ?? '',
        placeholder: 'all, or FV-1*', list: 'valve-names'}),
      fault: h('select', {}),
      state: select(kStates, query.get('state') ?? ''),
      since: time('since'), until: time('until'),
    };
    this.#fillFaults(query.get('fault') ?? '');
  }

  #fillFaults(chosen) {
    const {fault} = this.#inputs;
    const value = fault.value || chosen;
    replace(fault, h('option', {value: ''}, 'any'),
        [...store.faults.keys()].map((key) => h('option', {value: key},
            key === 'unknown' ? 'without a name' : faultTitle(key))));
    if (value && !store.faults.has(value)) {
      fault.append(h('option', {value}, faultTitle(value)));
    }
    fault.value = value;
  }

  #form() {
    const {valve, fault, state, since, until} = this.#inputs;
    return h('form', {'class': 'query', 'aria-label': 'Question',
      'onsubmit': (event) => {
        event.preventDefault();
        this.#ask();
      }},
    field('Valve', valve), field('Fault', fault), field('State', state),
    field(`From (${zoneName()}; empty: ${kDefaultDays} days)`, since),
    field(`Until (${zoneName()})`, until),
    h('button', {class: 'primary'}, 'Show'),
    h('datalist', {id: 'valve-names'}, [...store.tiles.keys()].map((id) =>
      h('option', {value: id}))));
  }

  // The address changes, and with it the view.
  #ask() {
    const {valve, fault, state, since, until} = this.#inputs;
    const hash = link('history', '', {
      valve: valve.value.trim(), fault: fault.value, state: state.value,
      since: fromInput(since.value), until: fromInput(until.value),
    });
    if (location.hash === hash) this.#fetch();
    else location.hash = hash;
  }

  #time() {
    const since = fromInput(this.#inputs.since.value);
    return {
      since_ms: since ?? Date.now() - kDefaultDays * kDayMs,
      until_ms: fromInput(this.#inputs.until.value),
    };
  }

  async #fetch() {
    this.#rows = [];
    replace(this.#body);
    const rows = this.#fetchRows(false);
    try {
      const {valve, fault} = this.#inputs;
      const time = this.#time();
      const figures = await get('/statistics', {
        ...time, valve: valve.value.trim(), fault: fault.value});
      if (this.gone) return;
      replace(this.#statistics, statisticsSection(figures, time));
    } catch (error) {
      replace(this.#statistics, errorNote(error));
    }
    await rows;
  }

  async #fetchRows(older) {
    const {valve, fault, state} = this.#inputs;
    const question = ++this.#asked;
    const late = () => this.gone || question !== this.#asked;
    try {
      const {episodes, more} = await get('/history', {
        ...this.#time(), valve: valve.value.trim(), fault: fault.value,
        state: state.value, limit: kPage,
        before_ms: older ? this.#rows.at(-1)?.detected_ms : null,
      });
      if (late()) return;
      this.#rows.push(...episodes);
      this.#body.append(...episodes.map((row) => bodyRow(kColumns, row)));
      this.#more.hidden = !more;
      this.#table.hidden = this.#rows.length === 0;
      setText(this.#found, this.#rows.length === 0 ?
        'No episode fits the question.' :
        `${this.#rows.length}${more ? ' newest' : ''}`);
    } catch (error) {
      if (!late()) setText(this.#found, error.message);
    }
  }
}

export const historyView = (route) => new History(route);
