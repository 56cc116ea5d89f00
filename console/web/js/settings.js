// The user's choices; kept in the browser. Emits 'change'.

const kDefaults = {
  theme: 'auto', utc: false, density: 'comfortable', shortcuts: true,
};

/** Every view shows it, so all is drawn again; the others one view follows. */
export const isEverywhere = (name) => ['theme', 'utc'].includes(name);

function read(name) {
  try {
    const text = localStorage.getItem('fdi.' + name);
    return text === null ? kDefaults[name] : JSON.parse(text);
  } catch {
    return kDefaults[name];
  }
}

class Settings extends EventTarget {
  #values = Object.fromEntries(
      Object.keys(kDefaults).map((name) => [name, read(name)]));

  get(name) {
    return this.#values[name];
  }

  set(name, value) {
    if (this.#values[name] === value) return;
    this.#values[name] = value;
    try {
      localStorage.setItem('fdi.' + name, JSON.stringify(value));
    } catch {
      // Without storage the choice lasts as long as the page.
    }
    this.dispatchEvent(new CustomEvent('change', {detail: name}));
  }
}

export const settings = new Settings();

const dark = matchMedia('(prefers-color-scheme: dark)');

/** Paper is light. */
export function applyTheme(onPaper = false) {
  const choice = onPaper ? 'light' : settings.get('theme');
  const theme = choice === 'auto' ? (dark.matches ? 'dark' : 'light') : choice;
  document.documentElement.dataset.theme = theme;
}

export function nextTheme() {
  const next = {auto: 'light', light: 'dark', dark: 'auto'};
  settings.set('theme', next[settings.get('theme')]);
}

dark.addEventListener('change', () => {
  applyTheme();
  settings.dispatchEvent(new CustomEvent('change', {detail: 'theme'}));
});

// Plots are pictures, so they are drawn again for paper.
for (const event of ['beforeprint', 'afterprint']) {
  addEventListener(event, () => {
    applyTheme(event === 'beforeprint');
    settings.dispatchEvent(new CustomEvent('change', {detail: 'paper'}));
  });
}
