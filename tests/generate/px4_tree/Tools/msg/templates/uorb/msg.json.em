@{
import genmsg.gentools
import json

assert spec.full_name == genmsg.gentools.compute_full_type_name(spec.package, file_base_name + '.msg')
}@
{
	"name": @(json.dumps(spec.full_name)),
	"types": @(json.dumps(dict(zip(spec.names, spec.types)))),
	"arrays": @(json.dumps([field.array_len for field in spec.parsed_fields() if field.is_array])),
	"topics": @(json.dumps([all_topics.index(topic) for topic in topics]))
}
