"""What a file was at each write to it, from the log of strace."""

import re

CALLS = "openat,close,pwrite64,ftruncate,fallocate,sendfile,copy_file_range,rename"
CALL = re.compile(r"\d+ +(\w+)\((.*)\) += (\d+)")
WRITE = re.compile(r'(\d+), "([^"]*)", (\d+), (\d+)')


def states(log, path):
    """Contents that `path` had, one after the other, as the process that was traced wrote it."""
    files, names, open_files, last = {}, {}, {}, None
    for line in log.read_text().splitlines():
        match = CALL.match(line)
        if match is None:
            continue
        call, arguments, result = match[1], match[2], int(match[3])
        texts = [bytes.fromhex(text.replace("\\x", "")) for text in re.findall(r'"([^"]*)"', arguments)]
        _apply(files, names, open_files, call, arguments, result, texts)
        found = files.get(names.get(str(path)))
        if found is not None and call in ("pwrite64", "ftruncate", "fallocate", "rename") and bytes(found) != last:
            last = bytes(found)
            yield last


def _apply(files, names, open_files, call, arguments, result, texts):
    if call == "openat":
        name = texts[0].decode(errors="replace")
        if "run.nc" not in name:
            open_files.pop(result, None)
            return
        if name not in names:
            names[name] = len(files)
            files[names[name]] = bytearray()
        if "O_TRUNC" in arguments:
            files[names[name]].clear()
        open_files[result] = names[name]
    elif call == "close":
        open_files.pop(int(arguments), None)
    elif call == "pwrite64":
        descriptor, _, _, place = WRITE.match(arguments).groups()
        if int(descriptor) in open_files:
            content, place = files[open_files[int(descriptor)]], int(place)
            content.extend(bytes(max(0, place + result - len(content))))
            content[place : place + result] = texts[0][:result]
    elif call == "ftruncate":
        descriptor, length = map(int, arguments.split(", "))
        if descriptor in open_files:
            content = files[open_files[descriptor]]
            del content[length:]
            content.extend(bytes(length - len(content)))
    elif call == "fallocate":
        descriptor, _, place, length = map(int, arguments.split(", "))
        if descriptor in open_files:
            content = files[open_files[descriptor]]
            content.extend(bytes(max(0, place + length - len(content))))
    elif call in ("sendfile", "copy_file_range"):
        numbers = arguments.split(", ")
        target, source = (numbers[0], numbers[1]) if call == "sendfile" else (numbers[2], numbers[0])
        if int(target) in open_files:
            files[open_files[int(target)]][:] = files[open_files[int(source)]]
    elif call == "rename" and texts[0].decode() in names:
        names[texts[1].decode()] = names.pop(texts[0].decode())
