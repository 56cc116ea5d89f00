// Single keys, which can be switched off, and the list of them. Views add
// theirs by onKey(), which returns what takes them away again.

import {button, h, showDialog} from './dom.js';
import {nextTheme, settings} from './settings.js';

const keys = new Map();

/** @returns a function that removes the key. */
export function onKey(key, text, action) {
  keys.set(key, {text, action});
  return () => {
    if (keys.get(key)?.action === action) keys.delete(key);
  };
}

// A dialog that has been closed keeps the focus until the next frame if the
// button that opened it has been replaced meanwhile.
function isTyping(target) {
  if (target.closest?.('dialog:not([open])')) return false;
  return target.closest?.('input, select, textarea, dialog') !== null &&
      target.closest?.('input[type="checkbox"]') === null;
}

export function showHelp() {
  const on = h('input', {type: 'checkbox', checked: settings.get('shortcuts'),
    onchange: () => settings.set('shortcuts', on.checked)});
  const dialog = h('dialog', {class: 'help'}, h('h2', {}, 'Shortcuts'),
      h('table', {},
          h('thead', {}, h('tr', {}, h('th', {scope: 'col'}, 'Key'),
              h('th', {scope: 'col'}, 'What it does'))),
          h('tbody', {}, [...keys].map(([key, {text}]) => h('tr', {},
              h('td', {}, h('kbd', {}, key)), h('td', {}, text))))),
      h('label', {class: 'check'}, on, ' Single keys are switched on'),
      h('div', {class: 'buttons'},
          button('Close', () => dialog.close(), {class: 'primary'})));
  showDialog(dialog);
}

export function startShortcuts() {
  const go = (hash) => () => {
    location.hash = hash;
  };
  onKey('1', 'Plant', go('#/'));
  onKey('2', 'Alarms', go('#/alarms'));
  onKey('3', 'History', go('#/history'));
  onKey('4', 'Work list', go('#/worklist'));
  onKey('t', 'Theme: as the system, light, dark', nextTheme);
  onKey('u', 'Local time or UTC', () =>
    settings.set('utc', !settings.get('utc')));
  onKey('?', 'This list', showHelp);
  addEventListener('keydown', (event) => {
    if (!settings.get('shortcuts') || event.ctrlKey || event.metaKey ||
        event.altKey || isTyping(event.target)) return;
    const entry = keys.get(event.key);
    if (!entry) return;
    event.preventDefault();
    entry.action();
  });
}
