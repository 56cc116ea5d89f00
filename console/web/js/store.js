// The page's knowledge of the plant, kept up to date by the stream. Emits
// 'tiles' (detail: ids or null for all), 'alarms' (detail: the row or null),
// 'samples', 'gap', 'resync' (the connection is back; `gapFromMs`, and whether
// the monitor was restarted), 'connection', 'status' and, on the page of a
// plant, 'plant' each second.

import {get, getOptional} from './api.js';
import {globTest, groupOfId} from './format.js';
import {Stream} from './stream.js';

const kCatalogueRetryMs = 5000;
const kSparkLength = 60;
const kStatusPeriodMs = 10000;

class Store extends EventTarget {
  tiles = new Map();
  alarms = new Map();
  faults = new Map();
  groups = [];  // From the file of groups: {name, has(id)}.
  status = null;
  hasWorklist = false;
  offsetMs = 0;  // Clock of the monitor minus ours.
  stream = new Stream();
  #instance = null;
  #lostMs = null;
  #historyAway = false;

  /** @returns a promise that the names of faults are known, or cannot be. */
  start() {
    this.stream.addEventListener('message', ({detail}) => this.#take(detail));
    this.stream.addEventListener('state', () => this.#connection());
    this.stream.open(null);
    setInterval(() => this.#poll(), kStatusPeriodMs);
    this.refreshStatus();
    this.#resync();
    this.#probeWorklist();
    this.#loadGroups();
    return this.#loadCatalogue();
  }

  /** Names of the groups of valves that a person made. */
  groupsOf(id) {
    return this.groups.filter(({has}) => has(id)).map(({name}) => name);
  }

  /** The same; of a valve that is in none, the beginning of its id. */
  areasOf(id) {
    const names = this.groupsOf(id);
    return names.length > 0 ? names : [groupOfId(id)];
  }

  /** Samples of this valve come with the stream from now on; null: none. */
  watch(valve) {
    this.stream.open(valve);
  }

  nowMs() {
    return Date.now() + this.offsetMs;
  }

  /** Of a valve whose stamps are ahead of the clock, its newest stamp. */
  valveNowMs(valve) {
    return Math.max(this.nowMs(), this.tiles.get(valve)?.stamp_ms ?? 0);
  }

  /** The model set of that name, or null. */
  modelSet(name) {
    return this.status?.model_sets?.find((m) => m.model_set === name) ?? null;
  }

  // A page that nobody looks at has no stream; its title still counts alarms.
  #poll() {
    if (this.stream.resting) this.#resync();
    else this.refreshStatus();
  }

  async refreshStatus() {
    try {
      this.status = await get('/status');
      this.offsetMs = this.status.now_ms - Date.now();
      this.#emit('status');
      this.#updatePlant(this.status.plant);
    } catch {
      // The stream says so already.
    }
  }

  async #loadCatalogue() {
    try {
      const {faults} = await get('/faults');
      this.faults = new Map(faults.map((fault) => [fault.fault, fault]));
      this.#emit('tiles', null);
    } catch {
      // Keys have to do until the next attempt.
      setTimeout(() => this.#loadCatalogue(), kCatalogueRetryMs);
    }
  }

  #loadGroups() {
    return this.#fetch('/groups', ({groups}) => {
      this.groups = groups.map(({name, valves}) => {
        const tests = valves.map(globTest);
        return {name, has: (id) => tests.some((test) => test(id))};
      });
      this.#emit('tiles', null);
    });
  }

  async #probeWorklist() {
    try {
      this.hasWorklist = await getOptional('/worklist') !== null;
      this.#emit('status');
    } catch {
      // Asked again at the next connection.
    }
  }

  // Each by itself: of a plant, the history may be away.
  #resync() {
    return Promise.all([
      this.#fetch('/valves', ({valves}) => {
        this.tiles = new Map(valves.map((tile) => [tile.id, tile]));
        this.#emit('tiles', null);
      }),
      this.#fetch('/alarms', ({alarms}) => {
        this.alarms = new Map(alarms.map((row) => [row.episode, row]));
        this.#emit('alarms', null);
      }),
    ]);
  }

  async #fetch(where, take) {
    try {
      take(await get(where));
    } catch {
      // Comes again with the next connection.
    }
  }

  #updatePlant(plant) {
    if (!plant) return;
    const returned = this.#historyAway && !plant.history_away;
    this.#historyAway = Boolean(plant.history_away);
    if (this.status) this.status.plant = plant;
    this.#emit('plant', plant);
    if (returned) {
      this.#resync();
      this.#probeWorklist();
    }
  }

  #connection() {
    if (!this.stream.connected && this.#lostMs === null) {
      this.#lostMs = this.stream.heardMs ?? Date.now();
    }
    this.#emit('connection');
  }

  async #take({type, data}) {
    switch (type) {
      case 'hello': return this.#hello(data);
      case 'tiles': return this.#updateTiles(data.tiles);
      case 'alarm': return this.#updateAlarm(data);
      case 'sample': return this.#emit('samples', data);
      case 'plant': return this.#updatePlant(data);
      case 'gap': return this.#emit('gap', data);
    }
  }

  async #hello({now_ms: nowMs, instance}) {
    this.offsetMs = nowMs - Date.now();
    const restarted = this.#instance !== null && this.#instance !== instance;
    this.#instance = instance;
    if (this.#lostMs === null && !restarted) return;
    const gapFromMs = this.#lostMs;
    this.#lostMs = null;
    await Promise.all([this.#resync(), this.refreshStatus()]);
    this.#probeWorklist();
    this.#emit('resync', {gapFromMs, restarted});
  }

  #updateTiles(tiles) {
    for (const {v, ...tile} of tiles) {
      const old = this.tiles.get(tile.id);
      const spark = old?.spark ?? [];
      if (v !== undefined && tile.stamp_ms !== old?.stamp_ms) {
        spark.push(v);
        if (spark.length > kSparkLength) spark.shift();
      }
      this.tiles.set(tile.id, {...tile, spark});
    }
    this.#emit('tiles', tiles.map((tile) => tile.id));
  }

  #updateAlarm(row) {
    const known = this.alarms.has(row.episode);
    if (row.isa === 'NORMAL' || row.isa === 'NOTICE') {
      this.alarms.delete(row.episode);
    } else {
      this.alarms.set(row.episode, row);
    }
    this.#emit('alarms', {row, isNew: !known});
  }

  /** What an action answered; the stream will say the same again. */
  applyAlarm(row) {
    if (row?.episode) this.#updateAlarm(row);
  }

  #emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, {detail}));
  }
}

export const store = new Store();
