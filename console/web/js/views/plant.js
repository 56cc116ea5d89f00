// Every valve as a tile. Thousands of them: only the rows in sight are in the
// document, only what changed is touched, a few milliseconds of it a frame.

import {button, cssColor, h, replace, select, setText} from '../dom.js';
import {faultOfTile, faultTitle, isAlarm} from '../faults.js';
import {compareNames} from '../format.js';
import {rememberQuery} from '../route.js';
import {settings} from '../settings.js';
import {store} from '../store.js';
import {dataTable, timeCell} from './table.js';
import {compareTiles, rankOf, tailLength, Tile} from './tile.js';
import {oncePerFrame, View} from './view.js';

const kFrameBudgetMs = 4;
const kReorderPeriodMs = 500;
const kRowsBeyond = 3;  // Above and below what is in sight.

const kFilters = [
  {key: 'all', text: 'All', test: () => true},
  {key: 'alarm', text: 'In alarm', test: isAlarm},
  {key: 'unack', text: 'Unacknowledged', test: (t) =>
    t.unacked && t.shelved_until_ms === null},
  {key: 'silent', text: 'Not or partly judged', test: (t) =>
    t.quality !== 'LIVE' || t.state === 'PARTLY_JUDGED'},
];

function matches(tile, words) {
  if (words.length === 0) return true;
  const fault = isAlarm(tile) ? faultTitle(faultOfTile(tile)) : '';
  const text = [tile.id, fault, tile.quality, tile.model_set, tile.monitor,
    ...store.groupsOf(tile.id)].join(' ').toLowerCase();
  return words.every((word) => text.includes(word));
}

class Plant extends View {
  title = 'Plant';
  #ids = [];  // By name.
  #ranks = new Map();  // id -> number; smaller is worse.
  #shown = [];  // Ids that pass the filter, in their order.
  #tiles = new Map();  // id -> Tile, of those that were in sight.
  #inDocument = new Set();
  #dirty = new Set();
  #needsOrder = true;
  #tail = 0;  // Letters of an id that are never cut.
  #color = cssColor('--ink-soft');
  #filter;
  #words;
  #order;
  #search;
  #group;  // Only its valves; empty: all.
  #groupBox = h('select', {'aria-label': 'Group', 'onchange': () => {
    this.#group = this.#groupBox.value;
    this.#refilter();
  }});
  #shownGroups = '';
  #buttons = new Map();
  #monitor;  // Only its valves; empty: all.
  #monitors = h('div', {class: 'monitors'});
  #shownMonitors = '';
  #grid = h('ul', {class: 'tiles', role: 'list'});
  #nothing = h('p', {class: 'nothing', hidden: true});
  #workSoon = oncePerFrame(this, () => this.#work());
  #placeSoon = oncePerFrame(this, () => this.#place());

  constructor({query}) {
    super();
    this.#filter = query.get('show') ?? 'all';
    this.#order = query.get('order') ?? 'worst';
    this.#monitor = query.get('monitor') ?? '';
    this.#group = query.get('group') ?? '';
    this.#setWords(query.get('q') ?? '');
    this.element = h('section', {'class': 'plant', 'aria-label': 'Plant'},
        this.#controls(query.get('q') ?? ''), this.#monitors, this.#nothing,
        this.#grid);
    this.on(store, 'tiles', (ids) => this.#changed(ids));
    this.on(store, 'plant', () => this.#showMonitors());
    this.on(store, 'alarms', (change) => this.#redraw(change?.row.valve));
    this.on(settings, 'change', () => this.#showDensity());
    this.on(window, 'scroll', this.#placeSoon);
    this.on(window, 'resize', this.#placeSoon);
    this.every(kReorderPeriodMs, () => this.#needsOrder && this.#reorder());
    this.key('/', 'Search the valves', () => this.#search.focus());
    this.#showDensity();
    this.#showMonitors();
    this.#changed(null);
  }

  // Each second; focus and selection stay where nothing but a time changed.
  #showMonitors() {
    const monitors = store.status?.plant?.monitors ?? [];
    const key = JSON.stringify([this.#monitor, monitors.map(
        ({heard_ms: heard, silent, ...rest}) => [rest, silent && heard])]);
    if (key === this.#shownMonitors) return;
    this.#shownMonitors = key;
    const columns = [
      {text: 'Monitor', header: true, cell: ({monitor}) => button(monitor,
          () => this.#choose(monitor), {'class': 'chip',
            'aria-pressed': String(monitor === this.#monitor)})},
      {text: 'Host', class: 'wide', cell: ({host}) => host},
      {text: 'Health', cell: ({health, text, silent}) => silent ? 'silent' :
        [health ?? '–', text && `: ${text}`]},
      {text: 'Valves', class: 'num', cell: ({valves}) => String(valves)},
      {text: 'Last heard', cell: ({silent, heard_ms: heard}) => silent ?
        timeCell(heard) : 'now'},
    ];
    replace(this.#monitors, monitors.length > 0 && dataTable(
        'Monitors: press one to see only its valves', columns, monitors,
        {attributesOf: ({silent}) => ({class: silent ? 'out' : ''})}));
    this.#placeSoon();
  }

  #choose(monitor) {
    this.#monitor = monitor === this.#monitor ? '' : monitor;
    this.#showMonitors();
    this.#refilter();
  }

  #controls(text) {
    this.#search = h('input', {'type': 'search', 'value': text,
      'placeholder': 'Search', 'aria-label':
      'Search valve or fault', 'title': 'Key /', 'oninput': () => {
        this.#setWords(this.#search.value);
        this.#refilter();
      }});
    const filters = kFilters.map(({key, text: name}) => {
      const count = h('span', {class: 'chip-count'});
      const chip = button([name, ' ', count], () => {
        this.#filter = key;
        this.#refilter();
      }, {class: 'chip'});
      this.#buttons.set(key, {chip, count});
      return chip;
    });
    const order = select([['worst', 'Worst first'], ['name', 'By name']],
        this.#order, {'aria-label': 'Order', 'onchange': () => {
          this.#order = order.value;
          this.#refilter();
        }});
    const density = select(
        [['comfortable', 'Large tiles'], ['compact', 'Small tiles']],
        settings.get('density'), {'aria-label': 'Size of the tiles',
          'onchange': () => settings.set('density', density.value)});
    return h('div', {class: 'controls'}, h('h1', {}, 'Plant'), this.#search,
        h('div', {'class': 'chips', 'role': 'group', 'aria-label': 'Filter'},
            filters), this.#groupBox, order, density);
  }

  #setWords(text) {
    this.#words = text.toLowerCase().split(/\s+/).filter(Boolean);
  }

  #showDensity() {
    this.#grid.classList.toggle('compact',
        settings.get('density') === 'compact');
    this.#placeSoon();
  }

  #changed(ids) {
    if (ids === null) this.#ranks.clear();
    if (ids === null || ids.some((id) => !this.#ranks.has(id))) {
      this.#ids = [...store.tiles.keys()].sort(compareNames);
      this.#tail = tailLength(this.#ids);
      for (const tile of this.#tiles.values()) tile.showId(this.#tail);
    }
    for (const id of ids ?? this.#ids) {
      const [group] = rankOf(store.tiles.get(id));
      // Seen or not, alarms stand as in the work list.
      const rank = group === 1 ? 0 : group;
      if (this.#ranks.get(id) !== rank) this.#needsOrder = true;
      this.#ranks.set(id, rank);
      if (this.#inDocument.has(id)) this.#dirty.add(id);
    }
    if (ids === null) this.#reorder();
    this.#workSoon();
  }

  // A label is of the alarm, not of the tile; null: of any of them.
  #redraw(id) {
    this.#needsOrder = true;
    for (const each of id ? [id] : this.#inDocument) {
      if (this.#inDocument.has(each)) this.#dirty.add(each);
    }
    this.#workSoon();
  }

  // As much as the budget of one frame allows; the rest in the next ones.
  #work() {
    const end = performance.now() + kFrameBudgetMs;
    for (const id of this.#dirty) {
      this.#dirty.delete(id);
      const data = store.tiles.get(id);
      if (data && this.#inDocument.has(id)) this.#tiles.get(id).update(data);
      if (performance.now() > end) break;
    }
    if (this.#dirty.size > 0) this.#workSoon();
    else this.#count();
  }

  #shows(tile) {
    const filter = kFilters.find((f) => f.key === this.#filter) ?? kFilters[0];
    return (this.#monitor === '' || tile.monitor === this.#monitor) &&
        (this.#group === '' || store.areasOf(tile.id).includes(this.#group)) &&
        filter.test(tile) && matches(tile, this.#words);
  }

  #refilter() {
    this.#reorder();
    this.#count();
    rememberQuery('', '', {
      q: this.#search.value,
      show: this.#filter === 'all' ? '' : this.#filter,
      order: this.#order === 'worst' ? '' : this.#order,
      monitor: this.#monitor, group: this.#group,
    });
  }

  #count() {
    const tiles = [...store.tiles.values()];
    for (const {key, test} of kFilters) {
      const {chip, count} = this.#buttons.get(key);
      setText(count, String(tiles.filter(test).length));
      chip.setAttribute('aria-pressed', String(this.#filter === key));
    }
    this.#showGroups(tiles);
    this.#nothing.hidden = this.#shown.length > 0;
    setText(this.#nothing, tiles.length === 0 ?
      'No valve has been heard of yet. Each appears with ' +
        'its first sample on the bus.' : 'No valve fits the search.');
  }

  // "FV (12, 2 in alarm)"; without a choice of several, nothing.
  #showGroups(tiles) {
    const groups = new Map();
    for (const tile of tiles) {
      for (const name of store.areasOf(tile.id)) {
        const counts = groups.get(name) ?? {all: 0, alarms: 0};
        groups.set(name, counts);
        ++counts.all;
        if (isAlarm(tile)) ++counts.alarms;
      }
    }
    const options = [['', `All groups (${groups.size})`],
      ...[...groups].sort(([a], [b]) => compareNames(a, b))
          .map(([name, {all, alarms}]) => [name, `${name} (${all}` +
            (alarms > 0 ? `, ${alarms} in alarm)` : ')')])];
    const key = JSON.stringify(options);
    if (key === this.#shownGroups) return;
    this.#shownGroups = key;
    this.#groupBox.hidden = groups.size < 2 && this.#group === '';
    replace(this.#groupBox, options.map(([value, text]) =>
      h('option', {value}, text)));
    this.#groupBox.value = this.#group;
  }

  #reorder() {
    this.#needsOrder = false;
    this.#shown = this.#ids.filter((id) => this.#shows(store.tiles.get(id)));
    if (this.#order !== 'name') {
      this.#shown.sort((a, b) => this.#ranks.get(a) - this.#ranks.get(b) ||
          compareTiles(a, b));
    }
    this.#placeSoon();
  }

  // All tiles are of one size: which are in sight follows from where the grid
  // stands. Those elsewhere are room above and below.
  #place() {
    const {top} = this.#grid.getBoundingClientRect();
    const style = getComputedStyle(this.#grid);
    const pitch = parseFloat(style.gridAutoRows) + parseFloat(style.rowGap);
    const columns = style.gridTemplateColumns.split(' ').length;
    const rows = Math.ceil(this.#shown.length / columns);
    const first = Math.min(rows, Math.max(0,
        Math.floor(-top / pitch) - kRowsBeyond));
    const last = Math.min(rows,
        Math.ceil((innerHeight - top) / pitch) + kRowsBeyond);
    this.#grid.style.paddingTop = `${first * pitch}px`;
    this.#grid.style.paddingBottom = `${Math.max(0, rows - last) * pitch}px`;
    this.#fill(this.#shown.slice(first * columns, last * columns),
        first * columns);
  }

  // Few tiles move at a time: only those are touched.
  #fill(ids, before) {
    const wanted = new Set(ids);
    for (const id of this.#inDocument) {
      if (!wanted.has(id)) this.#tiles.get(id).element.remove();
    }
    let next = null;
    for (let i = ids.length - 1; i >= 0; --i) {
      const tile = this.#tileOf(ids[i]);
      if (!this.#inDocument.has(ids[i])) tile.update(store.tiles.get(ids[i]));
      tile.place(before + i + 1, this.#shown.length);
      if (tile.element.nextSibling !== next ||
          tile.element.parentNode !== this.#grid) {
        this.#grid.insertBefore(tile.element, next);
      }
      next = tile.element;
    }
    this.#inDocument = wanted;
  }

  #tileOf(id) {
    let tile = this.#tiles.get(id);
    if (!tile) {
      tile = new Tile(id, this.#color);
      tile.showId(this.#tail);
      this.#tiles.set(id, tile);
    }
    return tile;
  }
}

export const plantView = (route) => new Plant(route);
