/** Form for the token, if the address did not contain it. */

import { useSignal } from "@preact/signals";
import type { Connection } from "./connection.ts";
import { text } from "./strings.ts";

export function Login({ connection }: { connection: Connection }) {
  const refused = useSignal(false);
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    const form = new FormData(event.currentTarget as HTMLFormElement);
    refused.value = !(await connection.login(String(form.get("token")).trim()));
  };
  return (
    <div class="login">
      <form onSubmit={(event) => void submit(event)}>
        <img class="logo" src="/icon.svg" alt="" />
        <h1>{text.login.title}</h1>
        <p class="muted">{text.login.body}</p>
        <label for="token">{text.login.token}</label>
        <input
          class="field mono"
          id="token"
          name="token"
          autocomplete="off"
          required
          aria-invalid={refused.value}
          aria-describedby="refused"
        />
        <p id="refused" class="bad-text" role="alert">
          {refused.value ? text.login.refused : ""}
        </p>
        <button type="submit" class="button primary">
          {text.login.submit}
        </button>
      </form>
    </div>
  );
}
