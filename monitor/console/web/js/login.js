// Name and password, where the monitor wants a login.

import {errorOf, post, url} from './api.js';
import {field, h, replace} from './dom.js';

/** Fills `place` with a form. @returns a promise of a login. */
function ask(place) {
  const user = h('input', {autocomplete: 'username', required: true});
  const password = h('input', {type: 'password', required: true,
    autocomplete: 'current-password'});
  const wrong = h('p', {class: 'wrong', role: 'alert', hidden: true});
  const submit = h('button', {class: 'primary'}, 'Log in');
  const form = h('form', {class: 'login'}, h('h1', {}, 'Log in'),
      field('Name', user), field('Password', password), wrong,
      h('div', {class: 'buttons'}, submit));
  replace(place, form);
  user.focus();
  return new Promise((resolve) => {
    form.addEventListener('submit', async (event) => {
      event.preventDefault();
      submit.disabled = true;
      try {
        await post('/login', {user: user.value, password: password.value});
        replace(place);
        resolve();
      } catch (error) {
        wrong.hidden = false;
        replace(wrong, error.message);
        submit.disabled = false;
      }
    });
  });
}

/** Asks in `place` if need be. A session that ends starts the page anew. */
export async function logIn(place) {
  try {
    const answer = await fetch(url('/status'), {cache: 'no-store'});
    if (answer.status === 401) return await ask(place);
    if (answer.status === 403) throw await errorOf(answer);
  } catch (error) {
    if (!error.status) return;  // No monitor: the page says so and waits.
    replace(place, h('p', {class: 'note', role: 'alert'}, error.message));
    return new Promise(() => {});
  }
}

export async function logOut() {
  await post('/logout', {});
  location.reload();
}
