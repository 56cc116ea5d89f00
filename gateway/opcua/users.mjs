// Users and what they may do, from a file with lines NAME:HASH:ROLE. A hash is
// what `openssl passwd -6` prints; roles are those of the page.
import {execFile} from 'node:child_process';
import {timingSafeEqual} from 'node:crypto';
import {readFileSync} from 'node:fs';

const mayAct = ['acknowledge', 'engineer'];
const roles = ['view', ...mayAct];
const pauseMs = 1000;  // After a wrong password; a user's are tried one by one.
const longest = 256;   // Bytes of a password: hashing takes time.

export class Users {
  #byName = new Map();
  #turns = new Map();

  // Throws an error that names the line.
  constructor(file) {
    const lines = file ? readFileSync(file, 'utf8').split('\n') : [];
    lines.forEach((line, i) => {
      if (line.trim() === '' || line.startsWith('#')) return;
      const [name, hash, role, ...rest] = line.trim().split(':');
      const [, scheme, salt] = hash?.match(/^\$([56])\$([^$]+)\$[^$]+$/) ?? [];
      if (!name || !salt || rest.length > 0 || !roles.includes(role))
        throw Error(`${file} line ${i + 1}: expected NAME:HASH:ROLE, HASH as of ` +
          `\`openssl passwd -6\`, ROLE one of ${roles.join(', ')}`);
      this.#byName.set(name, {hash, scheme, salt, role});
    });
  }

  mayAct(name) { return mayAct.includes(this.#byName.get(name)?.role); }

  // @returns a promise of whether it is the password of this user.
  check(name, password) {
    if (!this.#byName.has(name)) return Promise.resolve(false);
    const turn = this.#turns.get(name) ?? Promise.resolve();
    const answer = turn.then(() => this.#isRight(name, password));
    this.#turns.set(name,
      answer.then(right => right || new Promise(resolve => setTimeout(resolve, pauseMs))));
    return answer;
  }

  #isRight(name, password) {
    const user = this.#byName.get(name);
    if (typeof password !== 'string' || Buffer.byteLength(password) > longest ||
        /[\n\0]/.test(password)) return false;
    return new Promise(resolve => {
      const openssl = execFile('openssl', ['passwd', `-${user.scheme}`, '-salt', user.salt, '-stdin'],
        {timeout: 5000}, (error, stdout) => {
          const made = Buffer.from(stdout.trim()), known = Buffer.from(user.hash);
          resolve(!error && made.length === known.length && timingSafeEqual(made, known));
        });
      openssl.stdin.on('error', () => {});
      openssl.stdin.end(`${password}\n`);
    });
  }
}
