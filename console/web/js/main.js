// Starts the page: what is on top, which view a link means.

import {replace} from './dom.js';
import {clockText, dateText, zoneName} from './format.js';
import {parseRoute} from './route.js';
import {applyTheme, isEverywhere, settings} from './settings.js';
import {createShell, startAnnouncements} from './shell.js';
import {startShortcuts} from './shortcuts.js';
import {store} from './store.js';
import {alarmsView} from './views/alarms.js';
import {episodeView} from './views/episode.js';
import {historyView} from './views/history.js';
import {plantView} from './views/plant.js';
import {valveView} from './views/valve.js';
import {worklistView} from './views/worklist.js';

// A map: a link may say "__proto__".
const kViews = new Map([
  ['', plantView], ['valve', valveView], ['alarms', alarmsView],
  ['episode', episodeView], ['history', historyView],
  ['worklist', worklistView],
]);

const main = document.getElementById('main');
let current = null;

/** Shows what the address says; `byUser` moves the focus there, too. */
function show(byUser) {
  const route = parseRoute(location.hash);
  current?.destroy?.();
  const view = kViews.get(route.name) ?? plantView;
  store.watch(view === valveView ? route.id : null);
  current = view(route);
  replace(main, current.element);
  scrollTo(0, 0);
  shell.showRoute(route.name, current.title);
  if (byUser) main.focus({preventScroll: true});
}

applyTheme();
startShortcuts();
const shell = createShell(document.getElementById('top'),
    document.getElementById('banner'));
startAnnouncements(document.getElementById('announcer'));
settings.addEventListener('change', ({detail}) => {
  if (detail === 'theme') applyTheme();
  if (isEverywhere(detail)) show(false);
});
// A time of today has no date, and paper outlasts the day.
addEventListener('beforeprint', () => main.dataset.printed =
  `Printed ${dateText(Date.now())} ${clockText(Date.now())}, ${zoneName()}`);
await store.start();
show(false);
addEventListener('hashchange', () => show(true));
