// Debian's Chromium without a window, and what tests ask of the page.

import {createRequire} from 'node:module';

// The packages of package.json stand in the build tree.
const require = createRequire(process.env.FDI_NODE_MODULES + '/');
const {chromium} = require('playwright-core');
const axe = require('axe-core');

// The login that nginx asks for (nginx.sh). Nobody vouches for its key.
const kEngineer = userOptions('engineer');

/** Options of open() for another user. */
export function userOptions(username, password = 'correct horse') {
  return {ignoreHTTPSErrors: true, httpCredentials: {username, password}};
}

export function launch() {
  return chromium.launch({
    executablePath: process.env.FDI_CHROMIUM,
    args: ['--headless', '--no-sandbox', '--disable-gpu', '--disable-quic',
      '--no-first-run', '--disable-background-networking',
      '--disable-component-update', '--disable-sync'],
  });
}

/**
 * A window at a link of the page. Its `faults` are the errors of scripts and
 * what they tried in vain, its `hosts` whom it asked for anything.
 */
export async function open(browser, address, hash, options = {}) {
  return show(await contextOf(browser, options), address, hash);
}

const shared = new Map();

/**
 * As open(), in a context that stays for tests with the same options: it has
 * read the files of the page already. End it with close().
 */
export async function openShared(browser, address, hash, options = {}) {
  const key = JSON.stringify(options);
  if (!shared.has(key)) shared.set(key, await contextOf(browser, options));
  return show(shared.get(key), address, hash);
}

/** Closes a page, and forgets what it had stored. */
export async function close(page) {
  await page.evaluate(() => {
    localStorage.clear();
    sessionStorage.clear();
  });
  await page.close();
}

function contextOf(browser, options) {
  return browser.newContext({viewport: {width: 1600, height: 1000},
    ...kEngineer, ...options});
}

async function show(context, address, hash) {
  const page = await context.newPage();
  page.faults = [];
  page.hosts = new Set();
  page.on('pageerror', (error) => page.faults.push(error.stack));
  // The browser never sends a request that the policy of the page forbids.
  page.on('console', (message) => {
    if (message.text().includes('Content Security Policy')) {
      page.faults.push(message.text());
    }
  });
  page.on('request', (request) =>
    page.hosts.add(new URL(request.url()).origin));
  await page.goto(`${address}/${hash}`);
  return page;
}

/** Light or dark, once the page has followed. */
export async function setScheme(page, scheme) {
  await page.emulateMedia({colorScheme: scheme});
  await page.locator(`html[data-theme=${scheme}]`)
      .waitFor({state: 'attached'});
}

/**
 * Complaints of axe about the page: "rule: elements". With `coloursOnly` what
 * may differ between light and dark alone.
 */
export async function accessibilityFaults(page, coloursOnly = false) {
  if (!await page.evaluate(() => 'axe' in window)) {
    await page.evaluate(axe.source);
  }
  const {violations} = await page.evaluate((some) => axe.run(
      some ? {runOnly: ['color-contrast']} : {}), coloursOnly);
  return violations.map(({id, nodes}) =>
    `${id}: ${nodes.slice(0, 3).map((node) => node.html).join(' ')}`);
}

/** Share of pixels of an element that differ from its commonest colour. */
export async function inkShare(page, selector) {
  const picture = await page.locator(selector).first().screenshot();
  return page.evaluate(async (bytes) => {
    const bitmap = await createImageBitmap(
        new Blob([new Uint8Array(bytes)], {type: 'image/png'}));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const pixels = new Uint32Array(context.getImageData(
        0, 0, canvas.width, canvas.height).data.buffer);
    const counts = new Map();
    for (const p of pixels) counts.set(p, (counts.get(p) ?? 0) + 1);
    return 1 - Math.max(...counts.values()) / pixels.length;
  }, [...picture]);
}
