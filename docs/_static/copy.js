// a button on every block of commands and of code; outputs have none
document.addEventListener("DOMContentLoaded", () => {
  const blocks = document.querySelectorAll(
    ["sh", "bash", "powershell", "python", "toml"].map((name) => `.highlight-${name} .highlight`).join(", ")
  );
  for (const block of blocks) {
    const text = block.querySelector("pre").textContent;
    const button = document.createElement("button");
    button.className = "copy";
    button.textContent = "Copy";
    button.addEventListener("click", async () => {
      await navigator.clipboard.writeText(text);
      button.textContent = "Copied";
      setTimeout(() => { button.textContent = "Copy"; }, 1500);
    });
    block.append(button);
  }
});
