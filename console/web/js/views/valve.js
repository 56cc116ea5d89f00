// One valve: what the observers say now, in words and numbers, and the trend.

import {getOptional, path} from '../api.js';
import {Timeline} from '../charts/timeline.js';
import {TrendData} from '../charts/trend_data.js';
import {button, h, replace, setText} from '../dom.js';
import {certaintyNode, factorTitle, faultName, faultOfTile, faultTitle, inAlarm,
  isAlarm, markWord, members, moreText, notJudgedText, openText, priorityNames, priorityOf, prioritySign,
  qualityText, stateWord} from '../faults.js';
import {durationText, numberText, percentText, strengthText,
  timeText, unitText} from '../format.js';
import {link} from '../route.js';
import {store} from '../store.js';
import {actionButtons, canAct, shelve} from '../actions.js';
import {exportPng} from '../charts/export.js';
import {HealthSection} from './health.js';
import {aboutNodes, dataTable, labelText} from './table.js';
import {View} from './view.js';

const kTrendSeconds = 900;  // As long as the monitor keeps.
const kWordsPeriodMs = 2000;

function stateLine(tile) {
  if (!tile) return ['not heard of yet'];
  const reason = qualityText(tile);
  const quality = [reason && h('span', {class: 'tag dashed'}, reason),
    tile.shelved_until_ms && h('span', {class: 'tag'},
        `shelved until ${timeText(tile.shelved_until_ms)}`),
    tile.shelf_planned_ms && h('span', {class: 'tag'},
        `shelf planned from ${timeText(tile.shelf_planned_ms)}`),
    tile.monitor && h('span', {class: 'tag'}, `monitor ${tile.monitor}`)];
  if (!isAlarm(tile)) {
    return [h('span', {class: 'tag'}, stateWord(tile.state)), quality];
  }
  const priority = priorityOf(tile);
  const label = store.alarms.get(tile.episode)?.label;
  return [
    h('span', {class: 'tag strong'},
        prioritySign(priority, members(faultOfTile(tile)).length > 0),
        inAlarm(tile) ? `${stateWord(tile.state)}: ` +
            faultTitle(faultOfTile(tile)) + moreText(tile) : openText(tile)),
    certaintyNode(tile),
    h('span', {class: 'tag'}, priorityNames[priority]),
    percentText(tile.strength) === '–' ? null :
      h('span', {class: 'tag', title: percentText(tile.strength)},
          strengthText(tile.strength)),
    tile.since_ms === null ? null : h('span', {class: 'tag'},
        `for ${durationText(store.valveNowMs(tile.id) - tile.since_ms)}`),
    label && h('span', {class: 'tag'}, `label: ${labelText(label)}`),
    quality,
    tile.episode ? h('a', {href: link('episode', tile.episode)},
        'Open the episode') : null,
  ];
}

function judged({residual, low, high, away, blind}) {
  if (away) return 'not judged now';
  if (residual === null || residual === undefined) return 'abstains';
  return residual > high ? 'above' : residual < low ? 'below' :
    blind ? 'within, but the limits are too wide to see a fault' : 'within';
}

const kServices = {F: 'flow', P: 'pressure', L: 'level', T: 'temperature',
  A: 'analysis'};

/** "Service: level, globe, grade 1. ", "Globe. "; empty if nothing is known. */
function serviceText({service, type, grade, group}) {
  const words = [kServices[service] ?? service, type,
    grade && `grade ${grade}`, group && `group ${group}`]
      .filter(Boolean).join(', ');
  return !words ? '' : service ? `Service: ${words}. ` :
    `${words[0].toUpperCase()}${words.slice(1)}. `;
}

/** ". Last work: recalibrated, 2026-11-20 by bo"; empty while none is done. */
function repairText({description, location, document, repairs}) {
  const last = repairs?.filter(({kind, at_ms: at}) =>
    kind !== 'ordered' && at <= store.nowMs()).at(-1);
  return !last ? '' : (description || location || document ? '. ' : '') +
    `Last work: ${markWord(last.kind)}, ${timeText(last.at_ms)}` +
    (last.who ? ` by ${last.who}` : '');
}

const kResidualColumns = [
  {text: 'Channel', header: true, cell: ({name, unit, over}) =>
    (unit ? `${name} [${unitText(unit)}]` : name) + (over ?? '')},
  {text: 'Residual', class: 'num', cell: (row) => numberText(row.residual)},
  {text: 'Thresholds', class: 'num', cell: ({low, high}) =>
    `${numberText(low)} … ${numberText(high)}`},
  {text: 'Judged', cell: judged},
];
const kFitColumns = [
  {text: 'Condition', header: true, cell: ({name}) => name},
  {text: 'Explains the data', cell: ({fits, d}) =>
    h('span', {title: d === null ? null : factorTitle(d)}, fits)},
];

// Says which models judge this valve, and what they cannot see.
function scopeText({model_set: set, missing}, about) {
  const models = set && store.modelSet(set);
  if (!models) return serviceText(about);
  const unseen = [...store.faults.values()].filter(({fault, label}) =>
    label && !models.faults.includes(fault)).map(({name}) => name);
  const normal = (models.undetectable ?? []).map(faultName);
  return serviceText(about) + `Judged by model set ${set}` +
      (missing?.length ? `, without ${missing.join(', ')}` : '') +
      (unseen.length === 0 ? ', which knows every fault.' :
        `. Faults that it cannot name: ${unseen.join('; ')}.`) +
      (normal.length === 0 ? '' :
        ` Faults that look normal to it: ${normal.join('; ')}.`);
}

/**
 * Explanations of the data, in words: [{name, fits, d, strong}]. While it is
 * normal, no fault is listed: those that change nothing then explain it, too.
 */
function explanations({faults, T}, state, d0, d, partly) {
  const normal = {name: 'normal', d: d0, fits: state === 'NOT_JUDGED' ?
    'not judged' : d0 < T && state !== 'NORMAL' ? 'no' :
    partly ? 'yes, as far as judged' : 'yes'};
  const ranked = faults.map((fault, f) => ({name: faultTitle(fault), d: d[f]}))
      .filter((row) => row.d >= T / 2).sort((a, b) => b.d - a.d);
  if (state === 'NOT_JUDGED') return [normal];
  if (state === 'NORMAL') {
    return [normal, ...(ranked.length === 0 ? [] : [{name: 'faults too small ' +
      'to see', fits: 'not excluded', d: null, quiet: true}])];
  }
  return [normal, ...ranked.slice(0, 6).map((row) => ({...row,
    fits: row.d >= T ? 'yes' : 'not excluded', strong: row.d >= T}))];
}

/**
 * Residuals against their thresholds, and what explains them.
 * @param away Nobody judges the valve now: these are its last ones.
 * @param blind Its limits are too wide to see a fault.
 */
function nowTables(data, partly, away, blind) {
  const {channels, faults, windows} = data.meta;
  const last = (name) => data.columns[name].at(-1);
  // Behind a channel its windows that are beyond their limits: they raise the
  // alarms of slow and small faults.
  const residuals = channels.flatMap((channel, c) => [
    {...channel, away, blind, residual: last(`r${c}`)},
    ...(windows ?? []).filter((window) => window.channel === channel.name)
        .map(({samples, of, value, low, high}) => ({...channel,
          over: `, ${of} over ${samples} samples`, residual: value, low,
          high}))]);
  return [
    dataTable(away ? 'Last residuals' : 'Residuals now', kResidualColumns,
        residuals, {attributesOf: (row) => ({class:
          ['above', 'below'].includes(judged(row)) ? 'out' : ''})}),
    dataTable('What explains the data now', kFitColumns,
        explanations(data.meta, away ? 'NOT_JUDGED' : last('state'), last('d0'),
            faults.map((_, f) => last(`d${f + 1}`)), partly),
        {attributesOf: ({strong, quiet}) =>
          ({class: strong ? 'out' : quiet ? 'quiet' : ''})}),
  ];
}

class ValvePage extends View {
  #data = new TrendData();
  #state = h('div', {class: 'state-line'});
  #words = h('p', {class: 'words'});
  #now = h('div', {class: 'now-tables'});
  #who = h('p', {class: 'hint'});
  #scope = h('p', {class: 'hint scope'});
  #actions = h('div', {class: 'actions'});
  #note = h('p', {class: 'note', role: 'status'});
  #checks = h('p', {class: 'checks'});
  #queue = [];  // Samples that come while the trend is being fetched.
  #loading = true;
  #retry = 0;
  #news = '';
  #about = {};

  #timeline;
  #shownState = '';

  constructor({id}) {
    super();
    this.id = id;
    this.title = id;
    const health = new HealthSection(id,
        () => notJudgedText(store.tiles.get(id)));
    this.#timeline = new Timeline(this.#data, {
      live: true, nowMs: () => store.nowMs(), silentMs: () =>
        store.stream.connected ? 0 : Date.now() - store.stream.heardMs,
      describe: `Trend of ${id}; arrows move, plus and minus zoom`,
    });
    this.element = h('article', {class: 'valve'},
        h('div', {class: 'controls'}, h('h1', {}, id), this.#state,
            this.#actions),
        h('div', {class: 'live'}, this.#words, this.#checks,
            this.#who, this.#now),
        this.#note,
        h('div', {class: 'row-end'}, button('Save as PNG', () =>
          exportPng(this.#timeline, id)), h('a', {href: link('history', '', {valve: id})},
            'Episodes of this valve')),
        this.#timeline.element,
        h('p', {class: 'hint for-mouse'}, 'Drag to zoom, Shift and drag to ' +
          'pan, double click for all; Ctrl and wheel zoom, Shift and wheel pan.'),
        this.#scope,
        health.element);
    this.atEnd(() => {
      clearTimeout(this.#retry);
      this.#timeline.destroy();
      health.destroy();
    });
    this.#listen();
    this.#loadAbout();
    this.#load(false);
  }

  #listen() {
    const on = (type, action) => this.on(store, type, action);
    on('tiles', (ids) => {
      if (ids === null || ids.includes(this.id)) this.#showState();
    });
    on('alarms', () => this.#showState());
    on('status', () => this.#showState());
    on('samples', (samples) => this.#take(samples));
    on('gap', (gap) => {
      if (gap.valve === null || gap.valve === this.id) this.#data.addGap(gap);
    });
    on('connection', () => this.#connection());
    on('resync', (detail) => this.#resync(detail));
    this.every(1000, () => {
      this.#showState();
      if (this.#data.openGapFromMs !== null) this.#timeline.update();
    });
    this.every(kWordsPeriodMs, () => this.#refreshWords());
    this.#showState();
  }

  // The stream has numbers; the words are the monitor's.
  async #refreshWords() {
    if (this.#loading || !store.stream.connected) return;
    try {
      const trend = await getOptional(path('valves', this.id, 'trend'),
          {seconds: 1});
      if (trend && !this.gone) {
        this.#data.words = trend.words ?? '';
        this.#data.meta.windows = trend.windows;
        this.#showNow();
      }
    } catch {
      // Asked again soon.
    }
  }

  async #loadAbout() {
    try {
      this.#about = await getOptional(path('valves', this.id, 'about')) ?? {};
      replace(this.#who, h('span', {}, aboutNodes(this.#about)),
          repairText(this.#about));
      if (!this.gone) this.#showState();
    } catch {
      // The page shows what is known without it.
    }
  }

  async #load(keep) {
    this.#loading = true;
    clearTimeout(this.#retry);
    try {
      const trend = await getOptional(path('valves', this.id, 'trend'),
          {seconds: kTrendSeconds});
      if (this.gone) return;
      if (trend === null) {
        this.#wait(keep, `${this.id} has sent nothing to this monitor yet.`);
        return;
      }
      this.#loading = false;
      setText(this.#note, this.#news);
      this.#show(trend, keep);
    } catch (error) {
      if (!this.gone) this.#wait(keep, error.message);
    }
  }

  // A valve that the monitor has not heard of yet may come.
  #wait(keep, text) {
    setText(this.#note, text);
    this.#retry = setTimeout(() => this.#load(keep), 2000);
  }

  #show(trend, keep) {
    const same = this.#data.load(trend, keep);
    this.#data.openGapFromMs = null;
    this.#data.append(this.#queue.splice(0));
    if (same && this.#timeline.panels.length > 0) this.#timeline.update();
    else this.#timeline.rebuild();
    this.#showNow();
  }

  #take(samples) {
    const own = samples.filter((sample) => sample.valve === this.id);
    if (own.length === 0) return;
    if (this.#loading) {
      this.#queue.push(...own);
      return;
    }
    if (this.#data.goesBack(own)) {
      this.#load(false);  // A source with earlier stamps: the trend is anew.
      return;
    }
    this.#markTransitions(own);
    this.#data.append(own);
    this.#timeline.update();
    this.#showNow();
  }

  // Marks come with the trend; those of now are seen in the samples.
  #markTransitions(samples) {
    let before = this.#data.columns?.state.at(-1) ?? null;
    for (const {state, t_ms: t} of samples) {
      if (before && state !== before) {
        this.#data.addMark({t_ms: t,
          kind: state === 'NORMAL' ? 'CLEARED' : state, text: ''});
      }
      before = state;
    }
  }

  #connection() {
    if (store.stream.connected) return;
    this.#data.openGapFromMs ??= this.#data.lastMs;
  }

  #resync({gapFromMs, restarted}) {
    if (restarted) {
      this.#news = 'The monitor was started again; ' +
        `nothing was heard from ${timeText(gapFromMs)} on.`;
    }
    this.#load(true);
  }

  #showNow() {
    const tile = store.tiles.get(this.id);
    const partly = tile?.state === 'PARTLY_JUDGED';
    const away = notJudgedText(tile);
    // The line above may say it already, behind the name of the alarm.
    const said = away !== '' && !inAlarm(tile) && isAlarm(tile) &&
        openText(tile).endsWith(away);
    setText(this.#words, said ? '' : away || unitText(this.#data.words) +
      (partly && this.#data.words ? ', as far as it is judged' : ''));
    this.#words.hidden = this.#words.textContent === '';
    if (this.#data.size > 0) {
      replace(this.#now, nowTables(this.#data, partly, away !== '',
          tile?.blind));
    }
  }

  #showState() {
    const tile = store.tiles.get(this.id);
    replace(this.#state, stateLine(tile));
    setText(this.#scope, tile ? scopeText(tile, this.#about) : '');
    if (tile && isAlarm(tile)) this.#data.priority = priorityOf(tile);
    const row = tile?.episode ? store.alarms.get(tile.episode) : null;
    const key = JSON.stringify([row, tile?.faults, tile?.fault,
      tile?.quality, store.status?.write]);
    if (key === this.#shownState) return;
    this.#showNow();
    this.#shownState = key;
    // Work can be planned on a healthy valve, too.
    replace(this.#actions, row ? actionButtons(row) :
      canAct() && button('Shelve', () => shelve({valve: this.id}),
          {'aria-label': `Shelve ${this.id}`}));
    // Also while the valve is not judged: the alarm stands.
    const checks = (tile ? members(faultOfTile(tile)) : [])
        .map((fault) => store.faults.get(fault)).filter((f) => f?.check);
    this.#checks.hidden = checks.length === 0;
    replace(this.#checks, checks.map(({fault, check}) => [
      h('strong', {}, `${faultName(fault)}: `), check, ' ']));
  }
}

export const valveView = (route) => new ValvePage(route);
