// Small helpers around the DOM; text only ever enters as text.

function append(node, children) {
  for (const child of children.flat(Infinity)) {
    if (child === null || child === undefined || child === false) continue;
    node.append(child);
  }
}

/**
 * An element: h('button', {class: 'x', onclick: f, disabled: true}, 'text').
 * Attributes that are null, undefined or false are left out.
 */
export function h(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith('on')) {
      node.addEventListener(name.slice(2), value);
    } else if (name === 'value') {
      node.value = value;
    } else {
      node.setAttribute(name, value === true ? '' : value);
    }
  }
  append(node, children);
  return node;
}

/** The same for SVG. */
export function svg(tag, attributes = {}, ...children) {
  const node = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [name, value] of Object.entries(attributes)) {
    node.setAttribute(name, value);
  }
  append(node, children);
  return node;
}

export function button(text, onclick, attributes = {}) {
  return h('button', {type: 'button', onclick, ...attributes}, text);
}

/** `options`: [[value, text]]. */
export function select(options, value, attributes = {}) {
  const node = h('select', attributes, options.map(([key, text]) =>
    h('option', {value: key}, text)));
  node.value = value;
  return node;
}

export function field(text, input) {
  return h('label', {class: 'field'}, h('span', {}, text), input);
}

/** `facts`: [[name, value]]. */
export function factList(facts) {
  return h('dl', {class: 'facts'}, facts.map(([name, value]) =>
    h('div', {}, h('dt', {}, name), h('dd', {}, value))));
}

export function errorNote(error) {
  return h('p', {class: 'note', role: 'alert'}, error.message);
}

// A browser makes a click of a press only if what was pressed is still there
// when the pointer is released. The end of some presses is never told.
const kLongestPressMs = 1000;
let pressed = null;
let pressEnd = 0;
const waiting = new Map();

export const isPressed = () => pressed !== null;

function endPress() {
  pressed = null;
  const all = [...waiting];
  waiting.clear();
  for (const [node, children] of all) replace(node, children);
}

function endPressAfter(ms) {
  clearTimeout(pressEnd);
  pressEnd = setTimeout(endPress, ms);
}

addEventListener('pointerdown', ({target}) => {
  pressed = target;
  endPressAfter(kLongestPressMs);
}, {capture: true, passive: true});
for (const end of ['pointerup', 'pointercancel']) {
  addEventListener(end, () => endPressAfter(0), {capture: true, passive: true});
}

/** Gives `node` new children; while one of the old is pressed, after that. */
export function replace(node, ...children) {
  if (pressed !== null && node.contains(pressed)) {
    waiting.set(node, children);
    return;
  }
  waiting.delete(node);
  node.replaceChildren();
  append(node, children);
}

/** Sets the text only if it differs: no layout for what stays. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Shows a dialog until it is closed; it is named by its first heading. */
export function showDialog(dialog) {
  const heading = dialog.querySelector('h2');
  heading.id = 'dialog-title';
  dialog.setAttribute('aria-labelledby', heading.id);
  dialog.addEventListener('close', () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

/** Value of a CSS variable, for canvases. */
export function cssColor(name) {
  return getComputedStyle(document.documentElement)
      .getPropertyValue(name).trim();
}

/** Hands a file to the user. */
export function download(name, blob) {
  const url = URL.createObjectURL(blob);
  h('a', {href: url, download: name}).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}
