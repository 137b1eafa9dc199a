/** Questions before an action: one dialog of the page. */

import { computed, signal } from "@preact/signals";
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

/** True while a question is open. */
export const asking = computed(() => pending.value !== null);

/** Ask the user, and return true if the action was chosen. A former question counts as cancelled. */
export function confirmed(question: Question): Promise<boolean> {
  cancelQuestion();
  return new Promise((answer) => (pending.value = { ...question, answer }));
}

/** Close the question, because the axes and devices that it names may be others now. */
export function cancelQuestion(): void {
  pending.peek()?.answer(false);
  pending.value = null;
}

export function ConfirmDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  const cancel = useRef<HTMLButtonElement>(null);
  const question = pending.value;
  useEffect(() => {
    if (question === null) return;
    const former = document.activeElement;
    if (dialog.current?.open === false) dialog.current.showModal();
    cancel.current?.focus();
    return () => {
      if (former instanceof HTMLElement) former.focus(); // for the keyboard and screen readers
    };
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
