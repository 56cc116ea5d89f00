// Our programs as children of a test.

import {execFile, spawn} from 'node:child_process';
import {mkdirSync, mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {connect, createServer} from 'node:net';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {fileURLToPath} from 'node:url';
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

/** A port of this machine that nobody uses at the moment. */
function freePort() {
  return new Promise((resolve) => {
    const server = createServer().listen(0, '127.0.0.1', () => {
      const {port} = server.address();
      server.close(() => resolve(port));
    });
  });
}

function listens(port) {
  return new Promise((resolve) => {
    const socket = connect(port, '127.0.0.1');
    socket.once('connect', () => resolve(true));
    socket.once('error', () => resolve(false));
    socket.once('close', () => socket.destroy());
    socket.once('connect', () => socket.end());
  });
}

/** A data directory, a domain and the programs in it; all end with stop(). */
export class Plant {
  data = mkdtempSync(path.join(tmpdir(), 'fdi-console-'));
  modelSet = 'quick';
  #domain = process.env.FDI_DOMAIN;
  #children = new Set();
  #proxy = path.join(this.data, 'proxy');
  #pagePort = 0;
  #address = '';

  constructor() {
    process.once('exit', () => this.#kill());
    mkdirSync(this.#proxy);
    writeFileSync(path.join(this.#proxy, 'proxy-secret'),
        '0123456789abcdef0123456789abcdef\n', {mode: 0o600});
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

  /** Starts a program; `errors` is what it has said on stderr. */
  start(program, ...words) {
    return this.#spawn(path.join(bin, program), ['--data', this.data,
      '--domain', this.#domain, '--transport', 'udp', ...words]);
  }

  #spawn(program, words) {
    const child = spawn(program, words, {stdio: ['ignore', 'ignore', 'pipe']});
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

  /** A monitor, on the same port as any before, and nginx in front of it. */
  async startMonitor() {
    this.#pagePort ||= await freePort();
    const monitor = this.start('fdi-monitor', 'run', '--model-set', this.modelSet,
        `--console=127.0.0.1:${this.#pagePort}`, '--console-proxy',
        path.join(this.#proxy, 'proxy-secret'));
    await until(() => monitor.errors.includes('monitor_ready') ||
        monitor.exitCode !== null, `monitor_ready\n${monitor.errors}`);
    this.#address ||= await this.#startProxy();
    return {monitor, address: this.#address};
  }

  async #startProxy() {
    const [https, http, metrics] =
        [await freePort(), await freePort(), await freePort()];
    const nginx = this.#spawn(
        fileURLToPath(new URL('nginx.sh', import.meta.url)),
        [this.#proxy, https, http, this.#pagePort, metrics].map(String));
    await until(() => listens(https), 'nginx').catch((error) => {
      throw new Error(`${error.message}\n${nginx.errors}`);
    });
    return `https://localhost:${https}`;
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
