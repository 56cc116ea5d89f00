// One valve of the plant view.

import {drawSparkline} from '../charts/sparkline.js';
import {h, replace, setText} from '../dom.js';
import {certaintyText, factorTitle, faultName, faultOfTile, faultTitle, inAlarm,
  isAlarm, members, moreText, priorityNames, priorityOf, prioritySign,
  qualityText, stateWord, unconfirmedText} from '../faults.js';
import {percentText, shortTimeText, strengthText, timeText} from '../format.js';
import {link} from '../route.js';
import {store} from '../store.js';
import {labelText} from './table.js';

const kIdTail = [6, 12];
const kTag = /[a-z]*[-_. ]?\d+[a-z]*$/i;  // "LIC-101A" at the end of an id.
const kDeviation = 0.3;  // As a share of 1 - d_0.
const kLasting = 3;  // Points beyond it in a row; healthy valves have single ones.

/** Letters at the ends of `ids` with the tag, that tell them apart, to a limit. */
export function tailLength(ids) {
  const tags = ids.map((id) => kTag.exec(id)?.[0].length ?? 0)
      .filter((length) => length <= kIdTail[1]);
  let length = Math.max(kIdTail[0], ...tags);
  while (length < kIdTail[1] &&
      new Set(ids.map((id) => id.slice(-length))).size < ids.length) ++length;
  return length;
}

/** How bad it is: [class, priority]; smaller is worse. */
export function rankOf(tile) {
  const shelved = tile.shelved_until_ms !== null;
  if (isAlarm(tile)) {
    return [shelved ? 2 : tile.unacked ? 0 : 1, priorityOf(tile)];
  }
  return [tile.unacked ? 3 : tile.state === 'NORMAL' ? 5 : 4, 0];
}

/** Alarms in the order of the work list; others stay as they are. */
export function compareTiles(a, b) {
  const [first, second] = [a, b].map((id) => store.tiles.get(id));
  if (!isAlarm(first) || !isAlarm(second)) return 0;
  const [one, two] = [first, second].map(({episode}) =>
    store.alarms.get(episode) ?? {score: 0, detected_ms: 0});
  return two.score - one.score || priorityOf(first) - priorityOf(second) ||
      two.detected_ms - one.detected_ms;
}

function whatText(tile) {
  if (isAlarm(tile)) {
    const name = faultName(faultOfTile(tile)) + moreText(tile, faultName);
    return name[0].toUpperCase() + name.slice(1);
  }
  if (tile.unacked) return 'Returned, unacknowledged';
  return {NOT_JUDGED: 'Not judged', PARTLY_JUDGED: 'Partly judged'}[
      tile.state] ?? '';
}

function deviates(spark) {
  let row = 0;
  return spark.some((v) => (row = v > kDeviation ? row + 1 : 0) >= kLasting);
}

// "strong, since 12:03"
function howText(tile) {
  const {strength, since_ms: since, unconfirmed_ms: unconfirmed} = tile;
  return [strengthText(strength), unconfirmed ?
    `not confirmed since ${shortTimeText(unconfirmed)}` : !inAlarm(tile) ?
    'not judged now' : since && `since ${shortTimeText(since)}`]
      .filter(Boolean).join(', ');
}

export class Tile {
  #position = 0;
  #count = 0;
  #sign = '';
  #tail = 0;
  #signBox = h('span', {class: 'sign-box'});
  #id = h('span', {class: 'tile-id'});
  #what = h('span', {class: 'tile-what'});
  #certainty = h('span', {class: 'tile-certainty'});
  #how = h('span', {class: 'tile-how'});
  #spoken = h('span', {class: 'sr-only'});  // Says what shape and colour show.
  #quality = h('span', {class: 'tile-quality'});
  #canvas = h('canvas', {'class': 'spark', 'aria-hidden': 'true',
    'title': 'Deviation from normal in the last minute'});
  #link = h('a', {}, h('span', {class: 'tile-head'}, this.#signBox, this.#id,
      this.#spoken, this.#certainty), this.#what, this.#how,
  h('span', {class: 'tile-foot'}, this.#canvas, this.#quality));
  element = h('li', {}, this.#link);

  constructor(id, color) {
    this.color = color;
    this.id = id;
    this.showId(kIdTail[0]);
    this.#id.title = id;
    this.#link.href = link('valve', id);
  }

  /** Cut in the middle if need be: its last `tail` letters stay. */
  showId(tail) {
    if (tail === this.#tail) return;
    this.#tail = tail;
    replace(this.#id,
        h('span', {class: 'id-head'}, this.id.slice(0, -tail)),
        h('span', {}, this.id.slice(-tail)));
  }

  update(tile) {
    const alarm = isAlarm(tile);
    const [rank, priority] = rankOf(tile);
    const what = whatText(tile);
    const label = store.alarms.get(tile.episode)?.label;
    const said = tile.shelved_until_ms !== null ?
      `shelved until ${timeText(tile.shelved_until_ms)}` :
      [qualityText(tile), label && `label: ${labelText(label)}`]
          .filter(Boolean).join('; ');
    const quality = said ||
      [tile.monitor, ...store.groupsOf(tile.id)].filter(Boolean).join(', ');
    this.element.className = 'tile' + (alarm ? ` alarm p${priority}` : '') +
        ` rank${rank}` + (tile.quality !== 'LIVE' ||
        tile.state === 'PARTLY_JUDGED' ? ' not-live' : '');
    this.#showSign(alarm ? priority : 0, tile.state === 'ISOLATED' ||
        members(faultOfTile(tile)).length > 0);
    setText(this.#what, what);
    setText(this.#certainty, alarm ? certaintyText(tile) : '');
    setText(this.#how, alarm ? howText(tile) : '');
    this.#how.title = !alarm ? '' : [
      strengthText(tile.strength) && `strength ${percentText(tile.strength)}`,
      tile.since_ms && `since ${timeText(tile.since_ms)}`,
      unconfirmedText(tile)].filter(Boolean).join(', ');
    this.#certainty.title = alarm && tile.factor !== null ?
      factorTitle(tile.factor) : '';
    setText(this.#quality, quality);
    this.#quality.title = quality;
    setText(this.#spoken, alarm ? `, ${priorityNames[priority]}, ` +
      stateWord(tile.state) + (tile.unacked ? ', unacknowledged' : '') :
      what ? '' : ', normal');
    this.#what.title = alarm ?
      faultTitle(faultOfTile(tile)) + moreText(tile) : '';
    // A calm valve draws no line: a line is a deviation, and says so. Words need
    // its room.
    const spark = tile.spark ?? [];
    this.#canvas.hidden = said !== '' || !deviates(spark);
    if (!this.#canvas.hidden) drawSparkline(this.#canvas, spark, this.color);
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
