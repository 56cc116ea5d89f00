// Our programs as children of a test.

import {execFile, execFileSync, spawn} from 'node:child_process';
import {mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {promisify} from 'node:util';

const kPatienceMs = 30000;
const bin = process.env.FDI_BIN;

/** Waits for what `condition` gives once it is something. */
export async function until(condition, what, patienceMs = kPatienceMs) {
  const end = Date.now() + patienceMs;
  for (;;) {
    const value = await condition();
    if (value) return value;
    if (Date.now() > end) throw new Error(`timed out: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
}

/** A data directory, a domain and the programs in it; all end with stop(). */
export class Plant {
  data = mkdtempSync(path.join(tmpdir(), 'fdi-console-'));
  // A proxy, which the browser plays, names anna.
  access = ['--console-users', path.join(this.data, 'proxied'),
    '--console-proxy-user', 'X-User', '--console-proxy-from', '127.0.0.1'];
  modelSet = 'quick';
  #domain = process.env.FDI_DOMAIN;
  #children = new Set();

  constructor() {
    process.once('exit', () => this.#kill());
    writeFileSync(this.access[1], 'anna:engineer:*\n', {mode: 0o600});
  }

  #kill() {
    for (const child of this.#children) child.kill('SIGKILL');
  }

  /** Runs a program to its end. @returns its stdout. */
  run(program, ...words) {
    return this.#run(kPatienceMs, program, words);
  }

  async #run(timeout, program, words) {
    const {stdout} = await promisify(execFile)(path.join(bin, program),
        ['--data', this.data, ...words], {timeout, maxBuffer: 1 << 26});
    return stdout;
  }

  /** A user of the console, with the name of the role, and `password`. */
  addUser(file, role, password) {
    execFileSync(path.join(bin, 'fdi-monitor'),
        ['console-user', role, '--role', role, '--users', file],
        {input: password + '\n'});
  }

  /** Starts a program; `errors` is what it has said on stderr. */
  start(program, ...words) {
    const child = spawn(path.join(bin, program),
        ['--data', this.data, '--domain', this.#domain, '--transport', 'udp',
          ...words], {stdio: ['ignore', 'ignore', 'pipe']});
    child.errors = '';
    child.stderr.on('data', (text) => child.errors += text);
    child.ended = new Promise((resolve) => child.once('exit', resolve));
    this.#children.add(child);
    return child;
  }

  train(campaign = process.env.FDI_CAMPAIGN, patienceMs = kPatienceMs) {
    return this.#run(patienceMs, 'fdi-trainer', ['train', '--campaign',
      campaign, '--log-level', 'warning']);
  }

  /** A monitor with a console on `port`, and the address of its page. */
  async startMonitor(port = 0, ...words) {
    const monitor = this.start('fdi-monitor', 'run', '--model-set', this.modelSet,
        `--console=127.0.0.1:${port}`, ...this.access, ...words);
    await until(() => monitor.errors.includes('monitor_ready') ||
        monitor.exitCode !== null, `monitor_ready\n${monitor.errors}`);
    const found = /console\S* .*?(127\.0\.0\.1:\d+)/.exec(monitor.errors);
    if (!found) throw new Error(`no address of a console:\n${monitor.errors}`);
    const scheme = this.access.includes('--console-tls') ? 'https' : 'http';
    return {monitor, address: `${scheme}://${found[1]}`};
  }

  /** A simulator of the conditions that the model set was trained in. */
  simulate(...words) {
    return this.start('fdi-simulator', 'run', '--parameters',
        'paper-operating-point', '--excitation', 'operating-point', '--set',
        'excitation.amplitude_pct=8', '--set', 'excitation.period_s=80',
        '--log-level', 'warning', ...words);
  }

  /**
   * The newest episode of that valve has a name. With it the priority may rise,
   * and what was acknowledged before has to be acknowledged again.
   */
  untilNamed(valve) {
    return until(async () => {
      const {episodes} = JSON.parse(await this.run('fdi-store', 'history',
          'list', '--valve', valve, '--json'));
      return episodes.length > 0 && episodes[0].fault !== 'unknown' &&
          episodes[0].fault !== null;
    }, `a name of the fault of ${valve}`);
  }

  async stop() {
    this.#kill();
    await Promise.all([...this.#children].map((child) => child.ended));
    rmSync(this.data, {recursive: true, force: true});
  }
}
