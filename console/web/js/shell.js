// The bar above every view: where one is, how many alarms, whether the data are
// fresh, the clock.

import {notes} from './api.js';
import {button, h, replace, setText} from './dom.js';
import {faultTitle, groups, groupOf, priorityNames, priorityOf, prioritySign}
  from './faults.js';
import {clockText, dateText, durationText, timeText, zoneName}
  from './format.js';
import {nextTheme, settings} from './settings.js';
import {showHelp} from './shortcuts.js';
import {store} from './store.js';

const kEntries = [
  {name: '', text: 'Plant', key: '1'},
  {name: 'alarms', text: 'Alarms', key: '2'},
  {name: 'history', text: 'History', key: '3'},
  {name: 'worklist', text: 'Work list', key: '4'},
];
const kPauseMs = 1000;  // In which new alarms are counted, not named.
const kGraceMs = 2000;  // A change of view reconnects; that is no news.

function countAlarms() {
  const counts = {};
  const priorities = [0, 0, 0, 0, 0];
  for (const row of store.alarms.values()) {
    const group = groupOf(row);
    counts[group] = (counts[group] ?? 0) + 1;
    if (group === 'UNACK') ++priorities[priorityOf(row)];
  }
  return {counts, priorities};
}

function alarmSummary() {
  const {counts, priorities} = countAlarms();
  const open = counts.UNACK ?? 0;
  return {
    open,
    text: groups.map((g) => `${counts[g.key] ?? 0} ${g.name.toLowerCase()}`)
        .join(', '),
    nodes: open === 0 ? [h('span', {class: 'calm'}, 'no new alarm')] :
      priorities.map((count, p) => count === 0 ? null :
        h('span', {class: 'count', title: priorityNames[p]},
            prioritySign(p), String(count))),
  };
}

function bannerText() {
  const {stream} = store;
  if (stream.connected || stream.resting) return '';
  if (stream.heardMs === null) {
    return stream.retryMs ? `No connection: ${stream.reason}.` : '';
  }
  if (Date.now() - stream.heardMs < kGraceMs) return '';
  return `Data stale since ${timeText(stream.heardMs)}` +
      ` (${stream.reason}). Trying again by itself.`;
}

function historyText() {
  const away = store.status?.plant?.history_away;
  const [note] = notes.values();
  if (!away && note) return `The plant's history: ${note}. All else is shown.`;
  return away ? `The plant's history is not there since ` +
      `${timeText(away.since_ms)} (${away.reason}). The valves are live; ` +
      'episodes come back by themselves.' : '';
}

// A plant tells how many monitors it has; a monitor tells how it is.
function healthText({plant, health, write}) {
  const silent = plant?.monitors.filter((m) => m.silent).length;
  return (!plant ? (health === 'OK' ? 'Monitor OK' : 'Monitor degraded') :
    `${plant.monitors.length} monitors` +
      (silent ? `, ${silent} silent` : health === 'OK' ? '' : ', degraded')) +
      (write ? '' : ', read-only');
}

export function createShell(top, banner) {
  const links = kEntries.map(({name, text, key}) => h('a', {
    'href': `#/${name}`, 'data-name': name, 'aria-keyshortcuts': key,
    'title': `${text} (key ${key})`,
  }, text));
  const summary = h('a', {class: 'summary', href: '#/alarms'});
  const health = h('span', {class: 'health'});
  const clock = h('span', {class: 'clock'});
  const user = h('span', {class: 'user'});
  const theme = button('', nextTheme, {title: 'Light or dark (key T)'});
  const utc = button('', () => settings.set('utc', !settings.get('utc')),
      {title: 'Local time or UTC (key U)'});
  const help = button('Shortcuts', showHelp, {class: 'help',
    title: 'Shortcuts (key ?)'});
  replace(top, h('span', {class: 'brand'}, 'Valves'),
      h('nav', {'aria-label': 'Views'}, links), summary,
      h('div', {class: 'tools'}, health, clock, user, utc, theme,
          help));

  let title = '';
  const showSummary = () => {
    const {open, text, nodes} = alarmSummary();
    replace(summary, nodes, h('span', {class: 'sr-only'}, ` alarms: ${text}`));
    summary.title = text;
    document.title = (open > 0 ? `(${open}) ` : '') + title;
  };
  const showStatus = () => {
    const {status} = store;
    links[3].hidden = !store.hasWorklist;
    const bad = status && status.health !== 'OK';
    setText(health, status ? healthText(status) : '');
    health.classList.toggle('bad', Boolean(bad));
    setText(user, status?.user ? `${status.user}, ${status.role}` : '');
    health.title = !status ? '' :
      `${status.software}, running for ` +
      durationText(store.nowMs() - status.started_ms);
  };
  const showSettings = () => {
    setText(theme, `Theme: ${settings.get('theme')}`);
    setText(utc, `Time: ${settings.get('utc') ? 'UTC' : 'local'}`);
  };
  const tick = () => {
    const now = store.nowMs();
    setText(clock, `${clockText(now)} ${zoneName()}`);
    clock.title = dateText(now);
    const lost = bannerText();
    const text = lost || historyText();
    banner.hidden = text === '';
    setText(banner, text);
    document.body.classList.toggle('stale', lost !== '');
  };
  store.addEventListener('alarms', showSummary);
  store.addEventListener('status', showStatus);
  store.addEventListener('connection', tick);
  settings.addEventListener('change', () => {
    showSettings();
    tick();
  });
  setInterval(tick, 1000);
  showSettings();
  showStatus();
  tick();
  return {
    showRoute(name, viewTitle) {
      title = `${viewTitle} – Valves`;
      for (const node of links) {
        const here = node.dataset.name === name ||
            (node.dataset.name === '' && name === 'valve') ||
            (node.dataset.name === 'alarms' && name === 'episode');
        if (here) node.setAttribute('aria-current', 'page');
        else node.removeAttribute('aria-current');
      }
      showSummary();
    },
  };
}

/** Says new alarms to screen readers; many at once become a number. */
export function startAnnouncements(node) {
  let waiting = [];
  const say = () => {
    const text = waiting.length > 3 ? `${waiting.length} new alarms` :
      waiting.map((row) => `New alarm: ${row.valve}, ${faultTitle(row.fault)}`)
          .join('. ');
    waiting = [];
    node.replaceChildren(document.createTextNode(text));
  };
  store.addEventListener('alarms', ({detail}) => {
    if (!detail?.isNew || detail.row.isa !== 'UNACK') return;
    if (waiting.push(detail.row) === 1) setTimeout(say, kPauseMs);
  });
}
