/** Questions before an action: one dialog of the page. */

import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { text } from "../strings.ts";

export interface Question {
  title: string;
  body: string;
  action: string;
}

interface Pending extends Question {
  answer: (yes: boolean) => void;
}

const pending = signal<Pending | null>(null);

/** Ask the user, and return true if the action was chosen. */
export function confirmed(question: Question): Promise<boolean> {
  return new Promise((answer) => (pending.value = { ...question, answer }));
}

export function ConfirmDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  const cancel = useRef<HTMLButtonElement>(null);
  const question = pending.value;
  useEffect(() => {
    if (question === null) return;
    dialog.current?.showModal();
    cancel.current?.focus();
  }, [question]);
  if (question === null) return null;
  const close = (yes: boolean) => {
    pending.value = null;
    question.answer(yes);
  };
  return (
    <dialog ref={dialog} aria-labelledby="confirm-title" onCancel={() => close(false)}>
      <h2 id="confirm-title">{question.title}</h2>
      <p>{question.body}</p>
      <div class="actions">
        <button ref={cancel} type="button" class="button" onClick={() => close(false)}>
          {text.common.cancel}
        </button>
        <button type="button" class="button primary" onClick={() => close(true)}>
          {question.action}
        </button>
      </div>
    </dialog>
  );
}
