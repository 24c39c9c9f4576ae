/** Lets the browser save a text as a file. */
export function download(file: string, text: string, type: string) {
  const url = URL.createObjectURL(new Blob([text], { type }));
  const link = document.createElement('a');
  link.href = url;
  link.download = file;
  link.click();
  // The browser has the address when the click returns, but reads from it later.
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
