// Chromium's side of the comparison between targets, behind the page's own scripts: once the page has opened the package
// that its address names, the poses of `poses.txt` are played, and the title becomes their checksum.
"use strict";

async function checkPage() {
  while (!sinew && element("message").hidden) await new Promise((resolve) => setTimeout(resolve, 50));
  if (!sinew) throw new Error(element("message").textContent);
  const [one, other] = sinew.components;
  for (const { name, maximum } of [one, other]) {
    location.hash = `${name}=${maximum}`;
    poseFromAddress();
  }
  if (sinew.call.sinew_weight(one.index) !== 0 || sinew.call.sinew_weight(other.index) !== other.maximum) {
    throw new Error("the pose of an address is mixed with the one before");
  }
  return `checksum ${checksum(sinew, new TextDecoder().decode(await read("poses.txt")))}`;
}

checkPage().then(
  (title) => (document.title = title),
  (error) => (document.title = `failed: ${error.message}`),
);
