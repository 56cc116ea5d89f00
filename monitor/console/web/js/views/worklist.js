// Which valves to open at the next stop, and why: the planner's first page.

import {get, url} from '../api.js';
import {h, replace} from '../dom.js';
import {faultTitle} from '../faults.js';
import {link} from '../route.js';
import {bodyRow, columns, headRow, scrollable} from './table.js';

const kColumns = [
  {text: 'Rank', class: 'num', cell: (row) => String(row.rank)},
  columns.priority, columns.valve,
  {text: 'Why', class: 'remark', cell: (row) => row.why},
  {text: 'Probable fault', cell: (row) => !row.fault ? row.name ?? '–' :
    row.episode ? h('a', {href: link('episode', row.episode)},
        faultTitle(row.fault)) : faultTitle(row.fault)},
  {text: 'For', cell: (row) => row.discipline ?? '–'},
  {text: 'What to check', class: 'remark wide', cell: (row) =>
    row.check ?? '–'},
];

class Worklist {
  title = 'Work list';
  #gone = false;
  #list = h('div', {});

  constructor() {
    this.element = h('section', {},
        h('div', {class: 'controls'}, h('h1', {}, 'Work list'),
            h('a', {class: 'button', href: url('/worklist.csv'),
              download: 'worklist.csv'}, 'Save as CSV'),
            h('button', {type: 'button', onclick: () => print()}, 'Print')),
        this.#list);
    replace(this.#list, h('p', {}, 'Loading …'));
    this.#load();
  }

  destroy() {
    this.#gone = true;
  }

  async #load() {
    try {
      const {rows} = await get('/worklist');
      if (this.#gone) return;
      replace(this.#list, rows.length === 0 ?
        h('p', {class: 'nothing'}, 'Nothing to do: no valve stands out.') :
        scrollable('Work list', h('table', {class: 'worklist'},
            h('caption', {class: 'sr-only'}, 'Valves, most urgent first'),
            h('thead', {}, headRow(kColumns)),
            h('tbody', {}, rows.map((row) => bodyRow(kColumns, row))))));
    } catch (error) {
      replace(this.#list, h('p', {class: 'note', role: 'alert'},
          error.status === 404 ?
            'This monitor has no work list.' : error.message));
    }
  }
}

export const worklistView = (route) => new Worklist(route);
