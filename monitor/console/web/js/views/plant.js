// Every valve as a tile. Thousands of them: only what changed is touched, a few
// milliseconds of it a frame, and sparklines only where they can be seen.

import {cssColor, h, setText} from '../dom.js';
import {faultTitle} from '../faults.js';
import {compareNames} from '../format.js';
import {rememberQuery} from '../route.js';
import {settings} from '../settings.js';
import {onKey} from '../shortcuts.js';
import {store} from '../store.js';
import {rankOf, Tile} from './tile.js';

const kFrameBudgetMs = 4;
const kReorderPeriodMs = 2000;

const kFilters = [
  {key: 'all', text: 'All', test: () => true},
  {key: 'alarm', text: 'In alarm', test: (t) => t.state !== 'NORMAL'},
  {key: 'unack', text: 'Unacknowledged', test: (t) => t.unacked},
  {key: 'silent', text: 'Not live', test: (t) => t.quality !== 'LIVE'},
];

function matches(tile, words) {
  if (words.length === 0) return true;
  const text = `${tile.id} ${tile.state === 'NORMAL' ? '' :
    faultTitle(tile.faults.join('|'))} ${tile.quality} ${tile.model_set ?? ''}`
      .toLowerCase();
  return words.every((word) => text.includes(word));
}

class Plant {
  title = 'Plant';
  #tiles = new Map();  // id -> Tile
  #dirty = new Set();
  #frame = 0;
  #color = cssColor('--ink-soft');
  #filter;
  #words;
  #order;
  #abort = new AbortController();
  #grid = h('ul', {class: 'tiles'});
  #nothing = h('p', {class: 'nothing', hidden: true});
  #observer = new IntersectionObserver((entries) => this.#seen(entries),
      {rootMargin: '100px'});

  constructor({query}) {
    this.#filter = query.get('show') ?? 'all';
    this.#order = query.get('order') ?? 'worst';
    this.#setWords(query.get('q') ?? '');
    this.element = h('section', {'class': 'plant', 'aria-label': 'Plant'},
        this.#controls(query.get('q') ?? ''), this.#nothing, this.#grid);
    this.#showDensity();
    const {signal} = this.#abort;
    store.addEventListener('tiles', ({detail}) => this.#changed(detail),
        {signal});
    settings.addEventListener('change', () => this.#showDensity(), {signal});
    this.#timer = setInterval(() => this.#reorder(), kReorderPeriodMs);
    this.#removeKey = onKey('/', 'Search the valves', () =>
      this.#search.focus());
    this.#changed(null);
  }
  #timer;
  #removeKey;
  #search;
  #buttons = new Map();

  destroy() {
    this.#abort.abort();
    this.#observer.disconnect();
    clearInterval(this.#timer);
    cancelAnimationFrame(this.#frame);
    this.#removeKey();
  }

  #controls(text) {
    this.#search = h('input', {'type': 'search', 'value': text,
      'placeholder': 'Search valve or fault', 'aria-label':
      'Search valve or fault', 'title': 'Key /', 'oninput': () => {
        this.#setWords(this.#search.value);
        this.#refilter();
      }});
    const filters = kFilters.map(({key, text: name}) => {
      const count = h('span', {class: 'chip-count'});
      const button = h('button', {type: 'button', class: 'chip', onclick: () => {
        this.#filter = key;
        this.#refilter();
      }}, name, ' ', count);
      this.#buttons.set(key, {button, count});
      return button;
    });
    const order = h('select', {'aria-label': 'Order', 'onchange': () => {
      this.#order = order.value;
      this.#refilter();
    }}, h('option', {value: 'worst'}, 'Worst first'),
    h('option', {value: 'name'}, 'By name'));
    order.value = this.#order;
    const density = h('select', {'aria-label': 'Size of the tiles',
      'onchange': () => settings.set('density', density.value)},
    h('option', {value: 'comfortable'}, 'Large tiles'),
    h('option', {value: 'compact'}, 'Small tiles'));
    density.value = settings.get('density');
    return h('div', {class: 'controls'}, h('h1', {}, 'Plant'), this.#search,
        h('div', {'class': 'chips', 'role': 'group', 'aria-label': 'Filter'},
            filters), order, density);
  }

  #setWords(text) {
    this.#words = text.toLowerCase().split(/\s+/).filter(Boolean);
  }

  #showDensity() {
    this.#grid.classList.toggle('compact',
        settings.get('density') === 'compact');
  }

  #changed(ids) {
    if (ids === null) {
      for (const [id, tile] of this.#tiles) {
        if (store.tiles.has(id)) continue;
        tile.element.remove();
        this.#tiles.delete(id);
      }
    }
    for (const id of ids ?? store.tiles.keys()) this.#dirty.add(id);
    if (!this.#frame) {
      this.#frame = requestAnimationFrame(() => this.#work());
    }
  }

  // As much as the budget of one frame allows; the rest in the next ones.
  #work() {
    const end = performance.now() + kFrameBudgetMs;
    let isNew = false;
    for (const id of this.#dirty) {
      this.#dirty.delete(id);
      const data = store.tiles.get(id);
      if (!data) continue;
      isNew = !this.#tiles.has(id) || isNew;
      const tile = this.#tiles.get(id) ?? this.#add(id);
      tile.update(data);
      tile.element.hidden = !this.#shows(data);
      if (performance.now() > end) break;
    }
    this.#frame = this.#dirty.size > 0 ?
      requestAnimationFrame(() => this.#work()) : 0;
    if (this.#dirty.size > 0) return;
    if (isNew) this.#reorder();
    this.#count();
  }

  #add(id) {
    const tile = new Tile(id, this.#color);
    this.#tiles.set(id, tile);
    this.#grid.append(tile.element);
    this.#observer.observe(tile.element);
    return tile;
  }

  #seen(entries) {
    for (const {target, isIntersecting} of entries) {
      target.tile.visible = isIntersecting;
      const data = store.tiles.get(target.tile.id);
      if (isIntersecting && data) target.tile.draw(data);
    }
  }

  #shows(tile) {
    const filter = kFilters.find((f) => f.key === this.#filter) ?? kFilters[0];
    return filter.test(tile) && matches(tile, this.#words);
  }

  #refilter() {
    for (const [id, tile] of this.#tiles) {
      tile.element.hidden = !this.#shows(store.tiles.get(id));
    }
    this.#reorder();
    this.#count();
    rememberQuery('', '', {
      q: this.#search.value,
      show: this.#filter === 'all' ? '' : this.#filter,
      order: this.#order === 'worst' ? '' : this.#order,
    });
  }

  #count() {
    const tiles = [...store.tiles.values()];
    for (const {key, test} of kFilters) {
      const {button, count} = this.#buttons.get(key);
      setText(count, String(tiles.filter(test).length));
      button.setAttribute('aria-pressed', String(this.#filter === key));
    }
    const none = !tiles.some((tile) => this.#shows(tile));
    this.#nothing.hidden = !none;
    setText(this.#nothing, tiles.length === 0 ?
      'No valve has been heard of yet.' : 'No valve fits the search.');
  }

  // Few tiles move at a time: only those are touched.
  #reorder() {
    const sorted = [...this.#tiles.keys()].sort(this.#order === 'name' ?
      compareNames : this.#compareWorst);
    let next = null;
    for (let i = sorted.length - 1; i >= 0; --i) {
      const {element} = this.#tiles.get(sorted[i]);
      if (element.nextSibling !== next) this.#grid.insertBefore(element, next);
      next = element;
    }
  }

  #compareWorst = (a, b) => {
    const [groupA, priorityA] = rankOf(store.tiles.get(a));
    const [groupB, priorityB] = rankOf(store.tiles.get(b));
    return groupA - groupB || priorityA - priorityB || compareNames(a, b);
  };
}

export const plantView = (route) => new Plant(route);
