// One valve of the plant view.

import {drawSparkline} from '../charts/sparkline.js';
import {h, setClass, setText} from '../dom.js';
import {faultName, faultTitle, priorityOf, priorityNames, qualityWord,
  stateWord} from '../faults.js';
import {clockText, factorText} from '../format.js';
import {link} from '../route.js';
import {prioritySign} from '../symbols.js';

/** How bad it is: [class, priority]; smaller is worse. */
export function rankOf(tile) {
  const inAlarm = tile.state !== 'NORMAL';
  const shelved = tile.shelved_until_ms !== null;
  if (inAlarm && tile.unacked && !shelved) return [0, priorityOf(tile)];
  if (inAlarm && !shelved) return [1, priorityOf(tile)];
  if (inAlarm) return [2, priorityOf(tile)];
  if (tile.unacked) return [3, 0];
  return tile.quality === 'LIVE' ? [5, 0] : [4, 0];
}

function whatText(tile) {
  if (tile.state === 'DETECTED' && tile.faults.length === 0) {
    return 'Fault detected, not isolated yet';
  }
  if (tile.state !== 'NORMAL') return faultName(tile.faults.join('|'));
  return tile.unacked ? 'Returned, unacknowledged' : '';
}

function qualityText(tile) {
  if (tile.quality === 'LIVE') return '';
  const since = tile.quality === 'STALE' && tile.stamp_ms ?
    ` since ${clockText(tile.stamp_ms)}` : '';
  const reasons = tile.reasons ? `: ${tile.reasons.replaceAll('|', ', ')}` : '';
  return qualityWord(tile.quality) + since + reasons;
}

export class Tile {
  #position = 0;
  #count = 0;
  #sign = '';
  #signBox = h('span', {class: 'sign-box'});
  #id = h('span', {class: 'tile-id'});
  #what = h('span', {class: 'tile-what'});
  #factor = h('span', {class: 'tile-factor'});
  #spoken = h('span', {class: 'sr-only'});  // What shape and colour say.
  #quality = h('span', {class: 'tile-quality'});
  #canvas = h('canvas', {'class': 'spark', 'aria-hidden': 'true'});
  #link = h('a', {}, h('span', {class: 'tile-head'}, this.#signBox, this.#id,
      this.#spoken, this.#factor), this.#what, h('span', {class: 'tile-foot'},
      this.#canvas, this.#quality));
  element = h('li', {}, this.#link);

  constructor(id, color) {
    this.color = color;
    this.id = id;
    setText(this.#id, id);
    this.#link.href = link('valve', id);
  }

  update(tile) {
    const inAlarm = tile.state !== 'NORMAL';
    const [rank, priority] = rankOf(tile);
    const what = whatText(tile);
    const quality = qualityText(tile);
    setClass(this.element, 'tile' + (inAlarm ? ` alarm p${priority}` : '') +
        ` rank${rank}` + (tile.quality === 'LIVE' ? '' : ' not-live'));
    this.#showSign(inAlarm ? priority : 0, tile.state === 'ISOLATED');
    setText(this.#what, what);
    setText(this.#factor, inAlarm && tile.factor !== null ?
      factorText(tile.factor) : '');
    setText(this.#quality, tile.shelved_until_ms === null ? quality :
      `shelved until ${clockText(tile.shelved_until_ms)}`);
    setText(this.#spoken, inAlarm ? `, ${priorityNames[priority]}, ` +
      stateWord(tile.state) + (tile.unacked ? ', unacknowledged' : '') :
      what ? '' : ', normal');
    this.#what.title = inAlarm ? faultTitle(tile.faults.join('|')) : '';
    drawSparkline(this.#canvas, tile.spark ?? [], this.color);
  }

  /** Which of how many it is, for who cannot see the room around. */
  place(position, count) {
    if (this.#position === position && this.#count === count) return;
    this.#position = position;
    this.#count = count;
    this.element.setAttribute('aria-posinset', position);
    this.element.setAttribute('aria-setsize', count);
  }

  #showSign(priority, isolated) {
    const key = `${priority}${isolated}`;
    if (key === this.#sign) return;
    this.#sign = key;
    this.#signBox.replaceChildren();
    if (priority > 0) this.#signBox.append(prioritySign(priority, isolated));
  }
}
