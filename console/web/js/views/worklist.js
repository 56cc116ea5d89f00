// Which valves to open at the next stop, and why: the planner's first page.

import {get, url} from '../api.js';
import {button, errorNote, h, replace} from '../dom.js';
import {faultTitle} from '../faults.js';
import {link} from '../route.js';
import {columns, dataTable, forText, valveCell} from './table.js';
import {View} from './view.js';

const kColumns = [
  {text: 'Rank', class: 'num', cell: (row) => String(row.rank)},
  columns.priority,
  {text: 'Valve', header: true, cell: (row) =>
    valveCell(row.valve_id, row)},
  {text: 'Why', class: 'remark', cell: (row) => row.why},
  {text: 'Probable fault', cell: (row) => {
    const name = row.fault ? faultTitle(row.fault) : row.name ?? '–';
    return row.episode_id ?
      h('a', {href: link('episode', row.episode_id)}, name) : name;
  }},
  {text: 'For', cell: (row) => forText(row.discipline)},
  {text: 'What to check', class: 'remark check', cell: (row) =>
    row.check ?? '–'},
];

class Worklist extends View {
  title = 'Work list';
  #list = h('div', {}, h('p', {}, 'Loading …'));

  constructor() {
    super();
    this.element = h('section', {},
        h('div', {class: 'controls'}, h('h1', {}, 'Work list'),
            h('a', {class: 'button', href: url('/worklist.csv'),
              download: 'worklist.csv'}, 'Save as CSV'),
            button('Print', () => print())), this.#list);
    this.#load();
  }

  async #load() {
    try {
      const {rows} = await get('/worklist');
      replace(this.#list, rows.length === 0 ?
        h('p', {class: 'nothing'}, 'Nothing to do: no valve stands out.') :
        dataTable('Work list, most urgent first', kColumns, rows,
            {layout: 'cards'}));
    } catch (error) {
      replace(this.#list, errorNote(error));
    }
  }
}

export const worklistView = (route) => new Worklist(route);
